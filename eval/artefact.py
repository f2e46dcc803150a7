"""The front end of a run as a file: recorded once, replayed by variants of detector and back end.

A file holds every step that the back end and the scoring are given, to the bit, and is named by the
hash of everything that it depends on: the run's configuration without what comes after the front
end, the scene's content, the presets' contents, and the source code that makes the steps.
"""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eval.config import RunConfig
from eval.files import make_folder, whole_file
from eval.labels import KeptReturns, TruthStep
from eval.recordings import is_recording
from eval.seen import SeenStep
from eval.source import plan_of
from eval.steps import Step
from sim.sensorfile import sensor_named
from slam.arrayfile import ArrayFile
from slam.core import Frame, InputError, KeyframeScan, PlaneObservation, RunError
from slam.frontend import FrontEndConfig
from worlds.catalogue import scene_sha256
from worlds.conditions import conditions_named

AFTER_THE_FRONT_END = {
    *("scene", "out", "detector", "layers", "factors", "loops", "save", "cache"),
    *("truth", "topic"),
}
"""Fields of RunConfig that no step depends on (the scene's content counts, not its name)."""

CODE = (
    *("worlds", "sim"),
    *("slam.core", "slam.geometry", "slam.odometry"),
    *("slam.tracking", "slam.correspondence", "slam.localplanes", "slam.plumb"),
    *("slam.extraction", "slam.frontend"),
    *("slam.kiss", "slam.vgicp", "eval.registered"),
    *("eval.labels", "eval.seen", "eval.steps", "eval.artefact", "eval.source"),
)
"""Packages and modules that make the steps."""

PACKAGES = ("numpy", "scipy", "shapely", "mujoco", "open3d", "kiss-icp", "small_gicp")

Arrays = Mapping[str, NDArray]


def artefact_path(config: RunConfig) -> Path | None:
    """Where the front end of a run is kept; None for a run that keeps none or needs whole scans, or
    of a recording.

    Raises InputError for a scene or a preset that there is not.
    """
    if config.cache is None or config.save or is_recording(config.scene):
        return None
    return config.cache / f"{front_end_key(config)}.npz"


def front_end_key(config: RunConfig) -> str:
    """32 hexadecimal digits of all that the steps of a run depend on. Raises InputError."""
    used = [item.name for item in fields(config) if item.name not in AFTER_THE_FRONT_END]
    parts = [f"{name}={getattr(config, name)!r}" for name in used]
    parts.append(scene_sha256(config.scene))
    conditions = config.conditions or plan_of(config).conditions
    parts += [repr(sensor_named(config.sensor)), repr(conditions_named(conditions))]
    parts.append(repr(FrontEndConfig()))
    parts += [f"{name} {version(name)}" for name in PACKAGES]
    modules = [*CODE, config.odometry.partition(":")[0]] if ":" in config.odometry else [*CODE]
    parts += [code_hash(module) for module in modules]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()[:32]


@cache
def code_hash(module: str) -> str:
    """Of a module's source, or of all sources of a package."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        return module
    origin = Path(spec.origin)
    whole = spec.submodule_search_locations is not None
    files = sorted(origin.parent.rglob("*.py")) if whole else [origin]
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


def recorded(steps: Iterable[Step], path: Path) -> Iterator[Step]:
    """Passes steps on, and writes them to a file when they have all been taken.

    A front end that fails (RunError) is recorded with its failure; one that is stopped is not.
    """
    kept: list[Step] = []
    try:
        for step in steps:
            kept.append(Step(step.frame, step.truth))
            yield step
    except RunError as failure:
        write_steps(kept, str(failure), path)
        raise
    write_steps(kept, "", path)


class Replay:
    """The steps of a file. Raises InputError for one that cannot be read, and, while iterating,
    RunError where the recorded front end failed. duration: the end of the last sweep [s]."""

    def __init__(self, path: Path):
        self._arrays = _load(path)
        stamps = self._arrays["stamp"]
        self.duration = float(stamps[-1]) if len(stamps) else 0.0

    def __iter__(self) -> Iterator[Step]:
        frames, truths = _Frames(self._arrays), _Truths(self._arrays)
        for place in range(len(self._arrays["stamp"])):
            yield Step(frames.at(place), truths.at(place))
        if self._arrays["error"]:
            raise RunError(str(self._arrays["error"]))


def _load(path: Path) -> Arrays:
    try:
        arrays = ArrayFile(path, "a recorded front end").whole()
    except InputError as error:
        raise InputError(f"{error}; delete it") from error
    if missing := _written([], "").keys() - arrays.keys():
        raise InputError(f"{path}: expected a recorded front end with {min(missing)}; delete it")
    return arrays


# --- what is written ----------------------------------------------------------------------------


def write_steps(steps: Sequence[Step], error: str, path: Path) -> None:
    """Writes a file, whole or not at all. error: why the front end ended early, or empty."""
    make_folder(path.parent)
    with whole_file(path) as part, part.open("wb") as file:
        np.savez(file, **_written(steps, error))  # type: ignore[arg-type]  # its stub has allow_pickle only


def _written(steps: Sequence[Step], error: str) -> dict[str, NDArray]:
    frames = [step.frame for step in steps]
    scans = [frame.keyframe for frame in frames if frame.keyframe is not None]
    arrays = {"error": np.array(error), **_frame_arrays(frames), **_keyframe_arrays(scans)}
    return arrays | _truth_arrays([step.truth for step in steps])


def _frame_arrays(frames: Sequence[Frame]) -> dict[str, NDArray]:
    return {
        "index": np.array([frame.index for frame in frames], dtype=np.int64),
        "stamp": np.array([frame.stamp for frame in frames], dtype=np.float64),
        "T_odom_base": np.array([frame.T_odom_base for frame in frames]).reshape(-1, 4, 4),
        "T_track_base": np.array([frame.T_track_base for frame in frames]).reshape(-1, 4, 4),
        "keyframe": np.array([frame.keyframe is not None for frame in frames], dtype=bool),
    }


def _keyframe_arrays(scans: Sequence[KeyframeScan]) -> dict[str, NDArray]:
    planes = [plane for scan in scans for plane in scan.planes]
    return {
        "origin": np.array([scan.origin for scan in scans]).reshape(-1, 3),
        "plumb": np.array([_row(scan.plumb) for scan in scans]).reshape(-1, 3),
        "plane_count": np.array([len(scan.planes) for scan in scans], dtype=np.int64),
        **_ragged("scan_points", [scan.points for scan in scans], np.float32, 3),
        "normal": np.array([plane.normal for plane in planes]).reshape(-1, 3),
        "d": np.array([plane.d for plane in planes], dtype=np.float64),
        "centroid": np.array([plane.centroid for plane in planes]).reshape(-1, 3),
        "covariance": np.array([plane.covariance for plane in planes]).reshape(-1, 3, 3),
        **_ragged("plane_points", [plane.points for plane in planes], np.float32, 3),
        **_ragged("point_index", [plane.point_index for plane in planes], np.int32),
    }


def _row(plumb: NDArray | None) -> NDArray:
    return np.full(3, np.nan) if plumb is None else plumb


def _truth_arrays(truths: Sequence[TruthStep]) -> dict[str, NDArray]:
    kept = [truth.kept for truth in truths if truth.kept is not None]
    return {
        "start": np.array([truth.start for truth in truths], dtype=np.float64),
        "T_world_base": np.array([truth.T_world_base for truth in truths]).reshape(-1, 4, 4),
        **_ragged("seen_faces", [truth.seen.faces for truth in truths], np.int32),
        **_ragged("seen_returns", [truth.seen.returns for truth in truths], np.int32),
        **_ragged("seen_bins", [truth.seen.bins for truth in truths], np.int32),
        **_ragged("kept_rows", [part.rows for part in kept], np.int32),
        **_ragged("kept_faces", [part.faces for part in kept], np.int32),
        **_ragged("kept_along", [part.along for part in kept], np.float32),
        **_ragged("kept_points", [part.points for part in kept], np.float32, 3),
    }


def _ragged(
    name: str, parts: Sequence[NDArray], dtype: type, width: int | None = None
) -> dict[str, NDArray]:
    """Arrays of unequal length in one, and where each ends."""
    none: NDArray = np.empty((0,) if width is None else (0, width), dtype=dtype)
    ends = np.cumsum([0, *(len(part) for part in parts)])
    return {name: np.concatenate([none, *parts]).astype(dtype), f"{name}_ends": ends}


# --- what is read -------------------------------------------------------------------------------


class _Ragged:
    """The parts of ``_ragged``."""

    def __init__(self, arrays: Arrays, name: str):
        self._all, self._ends = arrays[name], arrays[f"{name}_ends"]

    def __getitem__(self, part: int) -> NDArray:
        return self._all[self._ends[part] : self._ends[part + 1]]


class _Frames:
    """Frames by their places."""

    def __init__(self, arrays: Arrays):
        self._arrays = arrays
        self._keyframe_of = np.cumsum(arrays["keyframe"]) - 1
        self._plane_ends = np.cumsum([0, *arrays["plane_count"]])
        self._scan_points = _Ragged(arrays, "scan_points")
        self._plane_points = _Ragged(arrays, "plane_points")
        self._point_index = _Ragged(arrays, "point_index")

    def at(self, place: int) -> Frame:
        arrays = self._arrays
        is_keyframe = bool(arrays["keyframe"][place])
        return Frame(
            index=int(arrays["index"][place]),
            stamp=float(arrays["stamp"][place]),
            T_odom_base=arrays["T_odom_base"][place],
            T_track_base=arrays["T_track_base"][place],
            keyframe=self._scan(int(self._keyframe_of[place])) if is_keyframe else None,
        )

    def _scan(self, keyframe: int) -> KeyframeScan:
        planes = range(self._plane_ends[keyframe], self._plane_ends[keyframe + 1])
        plumb = self._arrays["plumb"][keyframe]
        return KeyframeScan(
            planes=tuple(self._plane(plane) for plane in planes),
            points=self._scan_points[keyframe],
            origin=self._arrays["origin"][keyframe],
            plumb=None if np.isnan(plumb).any() else plumb,
        )

    def _plane(self, plane: int) -> PlaneObservation:
        arrays = self._arrays
        return PlaneObservation(
            normal=arrays["normal"][plane],
            d=float(arrays["d"][plane]),
            centroid=arrays["centroid"][plane],
            covariance=arrays["covariance"][plane],
            points=self._plane_points[plane],
            point_index=self._point_index[plane].astype(np.int64),
        )


class _Truths:
    """The truth of scans by their places."""

    def __init__(self, arrays: Arrays):
        self._arrays = arrays
        self._keyframe_of = np.cumsum(arrays["keyframe"]) - 1
        seen = ("seen_faces", "seen_returns", "seen_bins")
        self._seen = [_Ragged(arrays, name) for name in seen]
        kept = ("kept_rows", "kept_faces", "kept_along", "kept_points")
        self._kept = [_Ragged(arrays, name) for name in kept]

    def at(self, place: int) -> TruthStep:
        arrays = self._arrays
        faces, returns, bins = (part[place].astype(np.int64) for part in self._seen)
        kept = None
        if arrays["keyframe"][place]:
            rows, *others = (part[int(self._keyframe_of[place])] for part in self._kept)
            kept = KeptReturns(rows.astype(np.int64), *others)
        return TruthStep(
            index=int(arrays["index"][place]),
            stamp=float(arrays["stamp"][place]),
            start=float(arrays["start"][place]),
            T_world_base=arrays["T_world_base"][place],
            seen=SeenStep(faces, returns, bins),
            kept=kept,
        )
