"""What the paper says, copied from its tables, figures and text.

*Learning High-level Semantic-Relational Concepts for SLAM*. Lengths in metres, times in seconds.
What a mapping does not hold, the paper does not publish.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

NOT_PUBLISHED = "not published"

HYDRA, SGRAPHS, ROOMS_ONLY, OURS, GREEDY = (
    *("Hydra RS", "S-Graphs+", "Ours C, rooms only", "Ours C", "Ours G"),
)
"""The paper's methods, as the tables here call them."""

HYDRA_TUNED, SGRAPHS_TUNED = f"{HYDRA}, tuned", f"{SGRAPHS}, tuned"
"""The same with what suits a 16-beam sensor best (``eval.studies.baseline_search``)."""

BASELINES = (HYDRA, HYDRA_TUNED, SGRAPHS, SGRAPHS_TUNED)

WITHOUT_PLANES = (HYDRA, HYDRA_TUNED)
"""Their rooms have no pieces, so they are judged by their centres alone."""

SIMULATED = ("SC1F1", "SC1F2", "SE1", "SE2", "SE3")
REAL = ("RC1F1", "RC1F2", "RC2F2", "RC3F2")
MMA_SCENES = ("SE2", "SC1F1", "SC1F2", *REAL)

Values = Mapping[str, float]
"""By scene."""

SCENES: Mapping[str, str] = {
    "SC1F1": "1 L-shaped, 1 squared, 2 corridors",
    "SC1F2": "5 squared, 2 elongated, 1 corridor",
    "SE1": "6 squared, 3 corridors",
    "SE2": "5 squared, 2 elongated",
    "SE3": "22 squared, 4 corridors",
    "RC1F1": "1 L-shaped, 1 squared, 2 corridors",
    "RC1F2": "5 squared, 2 elongated, 1 corridor",
    "RC2F2": "7 squared, 2 L-shaped, 3 elongated",
    "RC3F2": "9 squared, 3 L-shaped, 2 corridors",
}
"""Table I."""


def _of(scenes: tuple[str, ...], values: str, scale: float = 1.0) -> Values:
    return dict(zip(scenes, (scale * float(v) for v in values.split()), strict=True))


WALL_PRECISION = dict.fromkeys((*SIMULATED, *REAL), 1.0)
WALL_RECALL = _of((*SIMULATED, *REAL), "0.80 1.00 0.87 0.43 0.89 0.80 0.75 0.82 0.84")
"""Table II."""

FIRST_ROOM: Mapping[str, Values] = {
    SGRAPHS: _of((*SIMULATED, *REAL), "76.0 19.0 19.0 115.0 160.0 19.0 25.5 367.0 308.0"),
    OURS: _of((*SIMULATED, *REAL), "2.7 2.8 10.2 8.2 37.1 1.7 2.6 54.0 210.2"),
}
"""Table III. Its caption says seconds, its head milliseconds; seconds are meant, since the text
speaks of the map points that have to be observed first."""

ATE: Mapping[str, Values] = {
    SGRAPHS: _of(SIMULATED, "2.72 6.93 1.47 1.36 2.98", 0.01),
    ROOMS_ONLY: _of(SIMULATED, "2.72 6.58 1.55 1.57 2.23", 0.01),
    OURS: _of(SIMULATED, "2.71 6.35 1.54 1.56 2.23", 0.01),
}
"""Table IV."""

MMA: Mapping[str, Values] = {
    SGRAPHS: _of(MMA_SCENES, "27.53 7.40 7.55 32.60 18.75 17.8 44.86", 0.01),
    ROOMS_ONLY: _of(MMA_SCENES, "27.52 7.61 7.53 32.54 18.64 17.8 44.35", 0.01),
    OURS: _of(MMA_SCENES, "27.51 7.60 7.51 32.67 17.79 17.27 43.31", 0.01),
}
"""Table V."""


@dataclass(frozen=True)
class Claim:
    """A relative figure of the text. variant less against, in percent of against's mean; scenes:
    the mean is over these; says: as the paper puts it."""

    what: str
    metric: str
    variant: str
    against: str
    scenes: tuple[str, ...]
    says: str


def _figure(variant: str, against: str, precision: str, recall: str) -> tuple[Claim, ...]:
    """Of the precision/recall figure; each text: simulated/real."""
    worlds = (("simulated", SIMULATED), ("real", REAL))
    return tuple(
        Claim(f"room {name}, {world}", f"rooms.centre_{name}", variant, against, scenes, says)
        for name, texts in (("precision", precision), ("recall", recall))
        for (world, scenes), says in zip(worlds, texts.split("/"), strict=True)
    )


FIGURE_CLAIMS = (
    *_figure(OURS, HYDRA, "+37 %/+9.5 %", "0 %/+16 %"),
    *_figure(OURS, SGRAPHS, "+16 %/0 %", "0 %/-11 %"),
    *_figure(GREEDY, OURS, '"-8 %" (degrades)/"2 %" (degrades)', "+21 %/+37 %"),
)
"""All that is published of the precision/recall figure, whose values stand in a picture only."""

FROM_MEANS = "1.7 % better, by the means of Table IV"
"""The text does not say it."""

CLAIMS = (
    Claim("first room, simulated", "first_room_s", OURS, SGRAPHS, SIMULATED, "84.3 % better"),
    Claim("first room, real", "first_room_s", OURS, SGRAPHS, REAL, "62.7 % better"),
    Claim("ATE", "ate_m", OURS, SGRAPHS, SIMULATED, "6.8 % better"),
    Claim("ATE", "ate_m", ROOMS_ONLY, SGRAPHS, SIMULATED, "5.2 % better"),
    Claim("ATE, what walls add", "ate_m", OURS, ROOMS_ONLY, SIMULATED, FROM_MEANS),
    Claim("MMA", "mma_m", OURS, SGRAPHS, MMA_SCENES, "1.8 % better"),
    Claim("MMA", "mma_m", ROOMS_ONLY, SGRAPHS, MMA_SCENES, "0.3 % better"),
)

COUNTS: Mapping[tuple[str, str], tuple[str, str]] = {
    ("SE3", HYDRA): ("9/13", "9/14"),
    ("SE3", SGRAPHS): ("7.5/9.5", "7.5/14"),
    ("SE3", OURS): ("10/10", "10/14"),
    ("RC2F2", HYDRA): ("-/-", "-/12"),
    ("RC2F2", SGRAPHS): ("7.5/9", "7.5/12"),
    ("RC2F2", OURS): ("7.5/9", "8/12"),
}
"""Precision and recall under the qualitative figure."""

WALL_COUNTS: Mapping[str, str] = {"SE3": "12/12", "RC2F2": "14/14"}
"""Walls under it."""
