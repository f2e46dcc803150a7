"""How far mapped planes are off the true ones: what the training set's noise is drawn from.

    python -m eval.studies.plane_noise RUN... > semantics/plane_noise.csv

RUN: folders of finished runs on buildings that serve for nothing else (random ones).
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from slam.core import Array, transform_plane, transform_points
from worlds.truth import Truth

MOST_TURNED = np.radians(30.0)
"""A plane that is further off is not that surface, whatever most of its points are [rad]."""


@dataclass(frozen=True)
class Mapped:
    """A mapped plane as a finished run left it, map frame, and the surface that it is of."""

    normal: Array
    d: float
    segment: Array
    surface: int


def plane_noise(planes: Iterable[Mapped], truth: Truth, T_world_map: Array) -> Array:
    """(N, 3) length [m], turn about the vertical [rad] and shift along the normal [m] of each."""
    of_surface = {face.surface: face for face in reversed(truth.faces)}
    rows = []
    for plane in planes:
        face = of_surface[plane.surface]
        normal, _ = transform_plane(T_world_map, plane.normal, plane.d)
        height = np.full((2, 1), np.mean(face.z_range))
        ends = transform_points(T_world_map, np.column_stack([plane.segment, height]))
        true, found = face.normal[:2], normal[:2] / np.linalg.norm(normal[:2])
        turn = np.arctan2(true[0] * found[1] - true[1] * found[0], true @ found)
        shift = float(face.normal @ ends.mean(axis=0) + face.d)
        if abs(turn) < MOST_TURNED:
            rows.append((float(np.linalg.norm(ends[1] - ends[0])), float(turn), shift))
    return np.array(sorted(rows)).reshape(-1, 3)


def noise_of_run(folder: Path) -> Array:
    """The rows of a finished run. Raises InputError where the folder holds none."""
    from eval.folder import read_config
    from eval.graphfile import PlaneNode, read_graph
    from eval.outputs import read_metrics
    from eval.source import make_world

    config, metrics = read_config(folder), read_metrics(folder / "metrics.json")
    graph = read_graph(folder / "graph.json")
    truth = make_world(config).truth
    planes = [
        Mapped(node.normal, node.d, node.segment, int(label.removeprefix("surface ")))
        for node in graph.nodes
        if isinstance(node, PlaneNode)
        and (label := graph.truth.get(node.id, "")).startswith("surface ")
    ]
    return plane_noise(planes, truth, np.array(metrics.T_world_map))


def noise_csv(rows: Array) -> str:
    """The file's text."""
    lines = [f"{length:.2f},{turn:.5f},{shift:.4f}" for length, turn, shift in rows.tolist()]
    return "\n".join(["length,turn,shift", *lines]) + "\n"


def main(folders: Sequence[str]) -> None:
    """Writes the rows of all runs to standard output."""
    rows = np.concatenate([noise_of_run(Path(folder)) for folder in folders])
    sys.stdout.write(noise_csv(rows[np.argsort(rows[:, 0], kind="stable")]))


if __name__ == "__main__":
    main(sys.argv[1:])
