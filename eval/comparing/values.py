"""The numbers of metrics.json by name: ``ate_m``, ``rooms.precision``, ``stages.graph.p95_ms``."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Iterator
from functools import cache

from eval.metrics import Metrics
from eval.names import refuse
from worlds.names import unknown

HIGHER_IS_BETTER = frozenset(
    {
        "map_completeness",
        "real_time_factor",
        *(f"rooms.{key}" for key in ("precision", "recall", "centre_precision", "centre_recall")),
        *(f"rooms.{key}" for key in ("true_positive", "mean_iou", "piece_f1")),
        *(f"walls.{key}" for key in ("precision", "recall", "true_positive")),
        "loops.true",
    }
)
LOWER_IS_BETTER = frozenset(
    {
        *("ate_m", "ate_keyframes_m", "ate_online_m", "ate_origin_m", "ate_xy_m", "ate_z_m"),
        *("yaw_deg", "rpe_percent", "ate_odometry_m", "ate_odometry_xy_m", "rpe_odometry_percent"),
        *("mma_m", "mma_face_m", "mma_floor_m", "plane_rmse_m", "planes.mixed"),
        *(
            f"failures.{what}_{cause}"
            for what in ("missed", "false")
            for cause in ("unseen", "planes", "edges", "clustering")
        ),
        *("planes.duplicates", "rooms.over_segmented", "rooms.under_segmented"),
        *("rooms.retracted_true", "rooms.id_switches"),
        *("loops.false", "loops.missed", "first_room_s", "room_latency_s.median"),
        *("room_latency_s.p95", "startup_s", "wall_s", "peak_rss_mb"),
        *(
            f"stages.{stage}.{key}"
            for stage in ("lidar", "odometry", "planes", "semantics", "graph")
            for key in ("median_ms", "p95_ms", "total_s")
        ),
    }
)
"""Of the numbers in neither set, such as counts of what is there, no change is good or bad."""


@cache
def metric_names() -> tuple[str, ...]:
    """All numbers, in the file's order."""
    return tuple(_numbers(Metrics, ""))


def _numbers(kind: type, prefix: str) -> Iterator[str]:
    for name, hint in typing.get_type_hints(kind).items():
        if dataclasses.is_dataclass(hint) and isinstance(hint, type):
            yield from _numbers(hint, f"{prefix}{name}.")
        elif {float, int} & {hint, *typing.get_args(hint)} and not _nested(hint):
            yield prefix + name


def _nested(hint: object) -> bool:
    return typing.get_origin(hint) in (tuple, dict)


def check_metric(what: str, name: str) -> str:
    """``name`` if it is a number of metrics.json; else InputError with the nearest ones."""
    if name not in metric_names():
        refuse(f"{what}: {unknown('metric', name, metric_names())}")
    return name


def value_of(metrics: Metrics, name: str) -> float | None:
    """A number by its name; None where it does not apply."""
    value: object = metrics
    for part in name.split("."):
        value = getattr(value, part)
    return None if value is None else float(typing.cast(float, value))


def sense(name: str) -> int:
    """1 where higher is better, -1 where lower is, 0 where neither."""
    return int(name in HIGHER_IS_BETTER) - int(name in LOWER_IS_BETTER)
