"""The picture of a training: loss, precision and recall by epoch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from eval.files import whole_file

if TYPE_CHECKING:
    from semantics.train import Curve


def curves_png(curves: Sequence[Curve], path: Path) -> Path:
    """One row a network: its loss on both sets, its precision and recall on the held-out one."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.2 * len(curves)), layout="constrained")
    axes = figure.subplots(len(curves), 2, squeeze=False)
    for (left, right), curve in zip(axes, curves, strict=True):
        epochs = range(1, len(curve.loss) + 1)
        left.semilogy(epochs, curve.loss, label="training")
        left.semilogy(epochs, curve.validation_loss, label="validation")
        left.set(title=f"{curve.name}: loss", xlabel="epoch", ylabel="cross-entropy per edge")
        by_relation = zip(
            curve.relations,
            zip(*curve.precision, strict=True),
            zip(*curve.recall, strict=True),
            strict=True,
        )
        for place, (relation, precision, recall) in enumerate(by_relation):
            right.plot(epochs, precision, color=f"C{place}", label=f"{relation}: precision")
            right.plot(epochs, recall, "--", color=f"C{place}", label=f"{relation}: recall")
        right.set(title=f"{curve.name}: validation", xlabel="epoch")
        for axis in (left, right):
            axis.axvline(curve.best + 1, color="0.6", linestyle=":", label="kept")
            axis.legend(fontsize=8)
            axis.grid(alpha=0.3)
    with whole_file(path) as part:
        figure.savefig(part, format="png", dpi=110)
    return path
