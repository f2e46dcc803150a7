"""What the terminal shows of scenes and of runs: the catalogue, scores, times, seeds in rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from eval.screen import line, number

if TYPE_CHECKING:
    from eval.comparing.scenario import Scenario
    from eval.metrics import Metrics, StageTime
    from worlds.catalogue import SceneCounts


def counts_table(scenes: Sequence[SceneCounts]) -> Table:
    """The catalogue: what each scene holds."""
    table = Table("scene", "rooms", "of which", box=SIMPLE_HEAD, padding=0)
    for column in ("doors", "storeys", "extent m", "area m2"):
        table.add_column(column, justify="right")
    for scene in scenes:
        table.add_row(
            scene.name,
            str(scene.room_total),
            ", ".join(f"{count} {shape}" for shape, count in scene.rooms),
            str(scene.doors),
            str(scene.storeys),
            "{:.1f} x {:.1f}".format(*scene.size),
            f"{scene.area:.1f}",
        )
    return table


def summary_table(metrics: Metrics) -> Table:
    """What a run scored, in six lines."""
    m, rooms, walls = metrics, metrics.rooms, metrics.walls
    table = Table("", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("precision", justify="right")
    table.add_column("recall", justify="right")
    table.add_column("")
    table.add_row(
        "rooms",
        number(rooms.precision, "{:.2f}"),
        number(rooms.recall, "{:.2f}"),
        f"{number(rooms.true_positive, '{:g}')} of {number(rooms.detected, '{:g}')} right, "
        f"{number(rooms.entered)} of {number(rooms.truth)} entered, "
        f"IoU {number(rooms.mean_iou, '{:.2f}')}",
    )
    table.add_row(
        "walls",
        number(walls.precision, "{:.2f}"),
        number(walls.recall, "{:.2f}"),
        f"{number(walls.true_positive)} of {number(walls.detected)} right, "
        f"{number(walls.truth)} to be found",
    )
    for name, text in (
        ("trajectory", f"ATE {_cm(m.ate_m)} (odometry alone {_cm(m.ate_odometry_m)})"),
        ("map", f"MMA {_cm(m.mma_m)} (sensor alone {_cm(m.mma_floor_m)})"),
        ("planes", f"RMSE {_cm(m.plane_rmse_m)}"),
        (
            "covariances",
            f"NEES: keyframes {number(m.consistency.keyframes.mean, '{:.2f}')}, "
            f"planes {number(m.consistency.planes.mean, '{:.2f}')} (1: honest)",
        ),
        (
            "first room",
            f"after {number(m.first_room_s, '{:.1f} s')}; "
            f"each: median {number(m.room_latency_s.median, '{:.1f} s')}",
        ),
    ):
        table.add_row(name, "", "", text)
    return table


def stages_table(metrics: Metrics) -> Table:
    """Where the time went."""
    table = Table("stage", box=SIMPLE_HEAD)
    for column in ("median ms", "p95 ms", "total s"):
        table.add_column(column, justify="right")
    for item in fields(metrics.stages):
        stage: StageTime = getattr(metrics.stages, item.name)
        times = (stage.median_ms, stage.p95_ms, stage.total_s)
        table.add_row(item.name, *(number(value, "{:.1f}") for value in times))
    return table


SUMMARY = (
    *("rooms.precision", "rooms.recall", "walls.precision", "walls.recall"),
    *("ate_m", "ate_odometry_m", "mma_m", "plane_rmse_m", "first_room_s"),
)
"""What a table of several runs shows where nothing else is asked for."""


def seeds_table(scenario: Scenario, runs: Mapping[int, Metrics]) -> Table:
    """One row a seed, and the mean: of what is bounded, or of ``SUMMARY``."""
    from eval.comparing.bounds import mean_of
    from eval.comparing.values import value_of

    names = list(dict.fromkeys(bound.metric for bound in scenario.bounds)) or list(SUMMARY)
    table = Table("seed", "status", box=SIMPLE_HEAD, title=scenario.name, title_justify="left")
    for name in names:
        table.add_column(name, justify="right")
    columns = [[value_of(metrics, name) for metrics in runs.values()] for name in names]
    for place, (seed, metrics) in enumerate(runs.items()):
        table.add_row(
            str(seed), metrics.status, *(number(column[place], "{:.4g}") for column in columns)
        )
    table.add_section()
    table.add_row("mean", "", *(number(mean_of(column), "{:.4g}") for column in columns))
    return table


def show_result(console: Console, metrics: Metrics, folder: Path) -> None:
    """The tables of a finished run, and where its files are."""
    m = metrics
    line(console, f"{m.scene}, {m.detector}, seed {m.seed}: {m.status}")
    console.print(summary_table(m))
    line(
        console,
        f"{number(m.simulated_s, '{:.1f}')} s simulated in {number(m.wall_s, '{:.1f}')} s: "
        f"{number(m.real_time_factor, '{:.1f}')} times real time",
    )
    console.print(stages_table(m))
    line(console, f"files: {folder}")


def _cm(metres: float | None) -> str:
    return "-" if metres is None else f"{100.0 * metres:.1f} cm"
