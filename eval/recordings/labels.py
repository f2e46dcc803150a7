"""The truth of a recorded drive in one npz file: of every return, of every face, wall and room.

Members: ``config`` (JSON: what the drive was asked for), ``stamps`` (S,), ``T_world_base`` (S, 4,
4); for scan i, in the order of its points, ``face_i`` (N,) int32 (a face, or a negative label),
``geom_i`` (N,) int32 and ``points_i`` (N, 3) float32, the returns at true poses in the world; of
the F faces ``face_room`` (F,), ``face_plane`` (F, 4) n and d, ``face_segment`` (F, 2, 2) and
``face_z`` (F, 2); ``walls`` (W, 2) pairs of faces; ``room_names`` (R,), and the corners of their
outlines one after another, ``room_corners`` (K, 2), with ``room_ends`` (R + 1,).
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from types import TracebackType

import numpy as np
from numpy.typing import NDArray

from eval.config import RunConfig
from eval.folder import config_in, config_text
from sim.truth import ScanTruth
from slam.arrayfile import ArrayFile
from slam.core import Array, InputError
from worlds.truth import Truth


class LabelsWriter:
    """Writes the file while a drive goes on, scan by scan; use it as a context manager."""

    def __init__(self, path: Path, config: RunConfig, truth: Truth) -> None:
        self._path = path
        self._part = path.with_name(f".{path.name}.part")
        self._config, self._truth = config, truth
        self._stamps: list[float] = []
        self._poses: list[Array] = []

    def __enter__(self) -> LabelsWriter:
        self._file = zipfile.ZipFile(self._part, "w", zipfile.ZIP_DEFLATED, compresslevel=1)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._put("config", np.array(config_text(self._config)))
        self._put("stamps", np.array(self._stamps))
        self._put("T_world_base", np.array(self._poses).reshape(-1, 4, 4))
        for name, table in _place(self._truth).items():
            self._put(name, table)
        self._file.close()
        self._part.replace(self._path)

    def write(self, stamp: float, truth: ScanTruth) -> None:
        """The next scan's."""
        number = len(self._stamps)
        self._put(f"face_{number}", truth.face)
        self._put(f"geom_{number}", truth.geom)
        self._put(f"points_{number}", truth.points_world)
        self._stamps.append(stamp)
        self._poses.append(truth.T_world_base)

    def _put(self, name: str, table: NDArray) -> None:
        with self._file.open(f"{name}.npy", "w", force_zip64=True) as member:
            np.lib.format.write_array(member, table, allow_pickle=False)


def _place(truth: Truth) -> dict[str, NDArray]:
    """Tables of faces, walls and rooms."""
    faces, rooms = truth.faces, truth.rooms
    outlines = [np.array(room.polygon.exterior.coords)[:-1] for room in rooms]
    return {
        "face_room": np.array([face.room for face in faces], dtype=np.int32),
        "face_plane": np.array([[*face.normal, face.d] for face in faces]).reshape(-1, 4),
        "face_segment": np.array([face.segment for face in faces]).reshape(-1, 2, 2),
        "face_z": np.array([face.z_range for face in faces]).reshape(-1, 2),
        "walls": np.array([wall.faces for wall in truth.walls], dtype=np.int32).reshape(-1, 2),
        "room_names": np.array([room.name for room in rooms], dtype=np.str_),
        "room_corners": np.concatenate([np.empty((0, 2)), *outlines]),
        "room_ends": np.cumsum([0, *map(len, outlines)]),
    }


class LabelsFile:
    """What ``LabelsWriter`` wrote. Raises InputError for anything else."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = file = ArrayFile(path, "labels of a recorded drive")
        self.config = config_in(str(file["config"]), path)
        self._stamps = file.shaped("stamps", "f", None)
        self._faces = len(file["face_room"])
        self._poses = file.shaped("T_world_base", "f", len(self._stamps), 4, 4)

    def at(self, stamp: float) -> ScanTruth:
        """The truth of the scan that ends at ``stamp`` [s]. Raises InputError if there is none."""
        number = int(np.argmin(np.abs(self._stamps - stamp))) if len(self._stamps) else -1
        if number < 0 or abs(float(self._stamps[number]) - stamp) > 1e-6:
            raise InputError(f"{self.path}: no scan ends at {stamp:.6f} s: another drive's labels?")
        points = self._file.shaped(f"points_{number}", "f", None, 3)
        face, geom = (
            self._file.shaped(f"{name}_{number}", "i", len(points)) for name in ("face", "geom")
        )
        if int(face.max(initial=-1)) >= self._faces:
            raise self._file.wrong(f"face_{number}: faces of the {self._faces} in face_room")
        return ScanTruth(self._poses[number], face, geom, points)
