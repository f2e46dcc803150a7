"""What a run knows of itself: what was asked for, how it ended, and on what it ran."""

from __future__ import annotations

import resource
import sys
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version

from eval.config import RunConfig
from eval.metrics import RunFacts
from eval.source import Place
from slam.core import RunError

PACKAGES = (
    "roomloop",
    "mujoco",
    "kiss-icp",
    "open3d",
    "torch",
    "gtsam",
    "numpy",
    "rerun-sdk",
)


def run_facts(config: RunConfig, place: Place, failure: BaseException | None) -> RunFacts:
    """What was run, how it ended, and on what. failure: what ended it early."""
    return RunFacts(
        status=_status(failure),
        error=str(failure) if isinstance(failure, RunError) else None,
        scene=config.scene,
        scene_sha256=place.sha256,
        seed=config.seed,
        sensor=config.sensor if place.recording is None else None,
        conditions=place.conditions,
        detector=config.detector,
        layers=config.layers,
        factors=config.factors,
        odometry=config.odometry,
        versions=_versions(),
        peak_rss_mb=_peak_rss_mb(),
    )


def _status(failure: BaseException | None) -> str:
    if failure is None:
        return "complete"
    return "failed" if isinstance(failure, RunError) else "cut_off"


def _versions() -> Mapping[str, str]:
    """What was installed, as far as it is known by name."""
    found = {"python": ".".join(map(str, sys.version_info[:3]))}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            continue
    return found


def _peak_rss_mb() -> float:
    """Largest memory of this process so far and of the simulator's, if it had one [MB]."""
    both = (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    return sum(resource.getrusage(which).ru_maxrss for which in both) / 1024.0
