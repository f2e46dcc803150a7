"""Generated buildings, driven through once, and what the baselines find in them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from eval.config import RunConfig
from eval.files import write_text
from eval.labels import TruthKeeper
from eval.parts import back_end_config, front_end
from eval.score.trajectory import Trajectory, score_trajectory
from eval.source import make_place
from semantics.freespace.gvd import Gvd, GvdConfig, gvd_of
from semantics.freespace.places import Places, places_of
from semantics.freespace.space import FreeSpace, SpaceConfig
from semantics.freespace.tsdf import TsdfConfig, Volume
from semantics.hydra.config import HydraConfig
from semantics.hydra.detector import HydraDetector
from semantics.sgraphs.config import SgraphsConfig
from semantics.sgraphs.detector import SgraphsDetector
from slam.backend import BackEnd
from slam.core import Array, InputError, MapView, Proposals
from worlds.generator import random_plan
from worlds.planfile import plan_text


@dataclass(frozen=True, eq=False)
class Drive:
    """A building, driven through and mapped without rooms. views: of the map after each keyframe,
    the last one after the last optimisation; T_world_map: (4, 4) aligns them with the truth."""

    name: str
    views: tuple[MapView, ...]
    keeper: TruthKeeper
    T_world_map: Array


def generated(seed: int, folder: Path) -> Path:
    """The plan file of a random building."""
    path = folder / f"generated-{seed}.json"
    folder.mkdir(parents=True, exist_ok=True)
    write_text(path, plan_text(random_plan(np.random.default_rng(seed))))
    return path


def drive_of(plan: Path, conditions: str, cache: Path) -> Drive:
    """Drives through a building, or replays it. Raises InputError or RunError if it cannot."""
    config = RunConfig(
        str(plan), conditions=conditions, detector="none", layers="planes", cache=cache
    )
    place = make_place(config)
    assert place.truth is not None
    keeper, backend = TruthKeeper(place.truth), BackEnd(back_end_config(config))
    views = []
    for step in front_end(config, place, keeper)[0]:
        keeper.add(step.truth)
        if backend.add(step.frame):
            views.append(backend.view())
    backend.finish()
    estimate = Trajectory(backend.stamps(), backend.trajectory())
    T_world_map = score_trajectory(estimate, keeper.trajectory).T_truth_estimate
    if T_world_map is None:
        raise InputError(f"{plan}: the drive is too short to be aligned with the truth")
    return Drive(plan.stem, (*views[:-1], backend.view()), keeper, T_world_map)


# --- free space, worked out once ------------------------------------------------------------------


@lru_cache(maxsize=16)
def _volume(drive: Drive, config: TsdfConfig) -> Volume:
    space = FreeSpace(SpaceConfig(tsdf=config))
    space.add(drive.views[-1])
    return space.volume()


@lru_cache(maxsize=16)
def _gvd(drive: Drive, tsdf: TsdfConfig, gvd: GvdConfig) -> Gvd:
    return gvd_of(_volume(drive, tsdf), gvd)


@lru_cache(maxsize=64)
def _places(drive: Drive, config: SpaceConfig) -> Places:
    gvd = _gvd(drive, config.tsdf, config.gvd)
    return places_of(gvd, _volume(drive, config.tsdf), config.places)


@lru_cache(maxsize=64)
def _skeletons(drive: Drive, config: SpaceConfig) -> dict[float, Places]:
    """Free space at the instants at which it was asked for already, to be filled."""
    return {}


class _KnownSpace:
    """Free space of a drive that many detectors read, worked out once."""

    def __init__(self, known: dict[float, Places], config: SpaceConfig):
        self._known, self._space = known, FreeSpace(config)
        self._view: MapView | None = None

    def add(self, view: MapView) -> bool:
        """Remembers what to integrate if it comes to that."""
        self._view = view
        return True

    def places(self) -> Places:
        """As of the last view."""
        assert self._view is not None
        if self._view.stamp not in self._known:
            self._space.add(self._view)
            self._known[self._view.stamp] = self._space.places()
        return self._known[self._view.stamp]


# --- rooms ----------------------------------------------------------------------------------------


def hydra_rooms(drive: Drive, config: HydraConfig) -> Proposals:
    """What Hydra finds in the final map."""
    final = drive.views[-1]
    known = {final.stamp: _places(drive, config.space)}
    return HydraDetector(config, _KnownSpace(known, config.space)).update(final)


def sgraphs_rooms(drive: Drive, config: SgraphsConfig) -> Proposals:
    """What S-Graphs+ has found by the end; it reads the planes as they are seen."""
    known = _skeletons(drive, config.space)
    detector = SgraphsDetector(config, _KnownSpace(known, config.space))
    for view in drive.views:
        detector.update(view)
    return detector.update(drive.views[-1])
