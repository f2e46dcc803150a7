"""At which dilation of the walls does free space fall into rooms? Versions 2 and 1 of the rule."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from semantics.freespace.gvd import Ints
from semantics.freespace.places import Places, components
from semantics.hydra.config import RoomsConfig
from slam.core import Array

Record = tuple[float, int]
"""A dilation [m], and how many components of sufficient size there are at it."""


def filtration(n: int, edges: Ints, widths: Array, least: int) -> list[Record]:
    """How the graph of ``n`` nodes falls apart as its edges go, narrowest first.

    One record an edge, by ascending width: the components of at least ``least`` nodes in the graph
    of the edges that are at least as wide.
    """
    parent, size = list(range(n)), [1] * n
    count = n if least <= 1 else 0
    records = []

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    for place in np.argsort(-np.asarray(widths), kind="stable"):
        a, b = root(int(edges[place, 0])), root(int(edges[place, 1]))
        if a != b:
            count -= (size[a] >= least) + (size[b] >= least)
            parent[b] = a
            size[a] += size[b]
            count += size[a] >= least
        records.append((float(widths[place]), int(count)))
    return records[::-1]


def window(
    records: Sequence[Record], low: float, high: float, clip: bool = False, least: float = 0.2
) -> slice:
    """The records from ``low`` on, to the last below ``high``, exclusively (as published).

    clip: end behind the largest count of all where that comes earlier, unless less than ``least``
    [m] would be left.
    """
    widths = [width for width, _ in records]
    start = next((k for k, width in enumerate(widths) if width >= low), len(records))
    below = [k for k, width in enumerate(widths) if width < high]
    end = below[-1] if below else len(records)
    if clip and records:
        peak = max(range(len(records)), key=lambda k: (records[k][1], -k))
        if start <= peak < end - 1 and widths[peak] - widths[start] >= least:
            end = peak + 1
    return slice(start, end)


def plateau(records: Sequence[Record], ratio: float) -> Record | None:
    """Of the long-lived counts the largest, and the least width at which it holds.

    A run of equal counts lives from its first to its last width; long-lived is one with at least
    ``ratio`` of the longest life.
    """
    runs = _runs(records)
    if not runs:
        return None
    longest = max(last - first for first, last, _ in runs)
    best = (runs[0][0], 0)
    for first, last, count in runs:
        if last - first >= ratio * longest and count > best[1]:
            best = (first, count)
    return best


def repeated(records: Sequence[Record]) -> Record | None:
    """The positive count that most records in a row have, the earliest of such, and the least width
    at which it holds."""
    best: tuple[int, Record] | None = None
    place = 0
    for count, run in groupby(records, key=lambda record: record[1]):
        length = len(list(run))
        if count > 0 and (best is None or length > best[0]):
            best = length, records[place]
        place += length
    return None if best is None else best[1]


def _runs(records: Sequence[Record]) -> list[tuple[float, float, int]]:
    """(first width, last width, count) of each run of equal counts."""
    runs: list[tuple[float, float, int]] = []
    for width, count in records:
        if runs and runs[-1][2] == count:
            runs[-1] = (runs[-1][0], width, count)
        else:
            runs.append((width, width, count))
    return runs


def dilation(places: Places, config: RoomsConfig) -> float | None:
    """The dilation [m] at which the rooms' cores remain; None if there are none."""
    if config.version == 1:
        return _median_dilation(places, config)
    records = filtration(len(places), places.edges, places.widths, config.min_component)
    inside = records[window(records, config.min_dilation, config.max_dilation)]
    chosen = repeated(inside) if config.repeated else plateau(inside, config.plateau_ratio)
    return None if chosen is None else chosen[0]


def cores(places: Places, threshold: float, least: int) -> list[Ints]:
    """Connected places wider than the dilation, over edges wider than it; the large ones."""
    inside = places.clearance > threshold
    edges = places.edges[(places.widths > threshold) & inside[places.edges].all(axis=1)]
    group = components(len(places), edges)
    group[~inside] = -1
    labels, sizes = np.unique(group[inside], return_counts=True)
    return [np.flatnonzero(group == label) for label in labels[sizes >= least]]


def _median_dilation(places: Places, config: RoomsConfig) -> float | None:
    """Version 1: the first dilation whose count is the median of those up to the last maximum.

    Where the counts only fall the whole list is taken (as later public versions did).
    """
    steps = np.linspace(config.min_dilation, config.max_dilation, config.steps + 2)
    counts = [len(cores(places, float(t), config.min_component)) for t in steps]
    if counts[0] == 0:
        return None
    last_peak = len(counts) - 1 - counts[::-1].index(max(counts))
    taken = counts[: (last_peak or len(counts) - 1) + 1]
    median = sorted(taken)[len(taken) // 2]
    return float(steps[taken.index(median)])
