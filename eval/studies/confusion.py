"""Pictures of what the networks confuse: the maps with the most wrong edges."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eval.files import whole_file
from semantics.dataset import SAME_ROOM, Sample, labels_of
from semantics.edges import EdgeModel, Edges

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLUMNS, ROWS = 3, 2


def confusion_png(weights: Sequence[Path], drawn: Sequence[Sample], path: Path) -> Path:
    """The samples with the most wrong room edges. Pieces have their true room's colour, those of no
    room are black; an edge that is wrongly found is red, one that is wrongly missed blue."""
    from matplotlib.figure import Figure

    model = EdgeModel(weights)
    told = [model(sample.pieces) for sample in drawn]
    wrong = [_wrong(sample, edges) for sample, edges in zip(drawn, told, strict=True)]
    worst = sorted(range(len(drawn)), key=lambda k: (-int(wrong[k].sum()), k))[: COLUMNS * ROWS]
    figure = Figure(figsize=(6.0 * COLUMNS, 6.0 * ROWS), layout="constrained")
    for axis, place in zip(figure.subplots(ROWS, COLUMNS, squeeze=False).flat, worst, strict=False):
        _draw(axis, drawn[place], told[place], wrong[place])
    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=80)
    return path


def _wrong(sample: Sample, edges: Edges) -> NDArray[np.bool_]:
    return (edges.room > 0.5) != (labels_of(sample, edges.pairs) == SAME_ROOM)


def _draw(axis: Axes, sample: Sample, edges: Edges, wrong: NDArray[np.bool_]) -> None:
    pieces = sample.pieces
    for segment, normal, centre, room in zip(
        pieces.segment, pieces.normal, pieces.centre, sample.room, strict=True
    ):
        color = "black" if room < 0 else f"C{room % 10}"
        axis.plot(*segment.T, color=color, linewidth=3)
        axis.plot(*np.array([centre, centre + 0.25 * normal]).T, color=color, linewidth=1)
    for (i, j), probability in zip(edges.pairs[wrong], edges.room[wrong], strict=True):
        found = probability > 0.5
        axis.plot(*pieces.centre[[i, j]].T, color="red" if found else "blue", linewidth=0.8)
    right = (labels_of(sample, edges.pairs) == SAME_ROOM).sum()
    axis.set(title=f"{int(wrong.sum())} wrong, {int(right)} to be found", aspect="equal")
