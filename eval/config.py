"""What a run is asked to do.

Light on purpose (standard library only until something is refused): the command line reads its
names and defaults from here before anything heavy is imported.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from pathlib import Path

from eval.detectors import DETECTORS, ODOMETRIES, check_name
from eval.names import known, refuse

LAYERS = ("planes", "rooms", "rooms+walls")
FACTORS = ("paper", "informative", "parallel", "perpendicular", "thickness", "merging")
"""As published; that and all relations between planes; or that and one kind of them."""
LOOPS = ("on", "off")


@dataclass(frozen=True)
class RunConfig:
    """One run. Raises InputError for values that no run could use.

    scene: a catalogue name or a file; seed: of everything random; out: the folder (None:
    ``runs/SCENE-DETECTOR-sN``); duration: simulated seconds (None: the whole route); speed: of the
    base [m/s] (None: the base's own); storey: counted from 0 (None: the lowest that can be driven);
    start: the room it starts in, by name; route: one that the scene names (None: every room);
    closed: return to the start; sensor, conditions: names of presets (conditions None: that which
    the scene names); detector, odometry: a name or ``package.module:Class``; layers: what enters
    the graph; factors: how rooms and walls constrain it; loops: loop closure; truth: of a
    recording, a .tum file, the labels (.npz) of a recorded drive, or a topic of the bag; topic: of
    a bag's point clouds; save: write recording.rrd; cache: a folder of recorded front ends
    (``eval.artefact``), which variants of detector and back end replay; unit, up: of a building's
    file that does not declare them (``worlds.readers.ReaderOptions``).
    """

    scene: str
    seed: int = 0
    out: Path | None = None
    duration: float | None = None
    speed: float | None = None
    storey: int | None = None
    start: str | None = None
    route: str | None = None
    closed: bool = False
    sensor: str = "vlp16"
    conditions: str | None = None
    detector: str = "gnn"
    odometry: str = "kiss"
    layers: str = "rooms+walls"
    factors: str = "paper"
    loops: str = "on"
    truth: str | None = None
    topic: str | None = None
    save: bool = False
    cache: Path | None = None
    unit: str | None = None
    up: str | None = None

    def __post_init__(self) -> None:
        _check_types(self)
        _check_counts(self)
        _check_positive(self)
        check_name("detector", self.detector, DETECTORS)
        check_name("odometry", self.odometry, ODOMETRIES)
        known("layers", self.layers, LAYERS)
        known("factors", self.factors, FACTORS)
        known("loops", self.loops, LOOPS)

    @property
    def folder(self) -> Path:
        """Where the run writes: ``out``, or ``runs/SCENE-DETECTOR-sN`` under the working folder."""
        if self.out is not None:
            return self.out
        return Path("runs") / f"{slug(Path(self.scene).stem)}-{slug(self.detector)}-s{self.seed}"


# --- values ---------------------------------------------------------------------------------------

MOST = 1e6
"""Of seconds, and of metres in one."""
SWEEP = 0.1
"""How long one sweep takes [s]."""
LONGEST = 1000
"""Characters of a name or a path."""

_TYPES: dict[str, tuple[tuple[type, ...], str]] = {
    "str": ((str,), "a text"),
    "int": ((int,), "a whole number"),
    "bool": ((bool,), "true or false"),
    "float": ((int, float), "a number"),
    "Path": ((str, Path), "a path"),
}


def _check_types(config: RunConfig) -> None:
    for item in fields(config):
        value = getattr(config, item.name)
        kind, _, optional = str(item.type).partition(" | ")
        if value is None and optional:
            continue
        types, expected = _TYPES[kind]
        if not isinstance(value, types) or (isinstance(value, bool) and kind != "bool"):
            refuse(f"{item.name}: expected {expected}, got {value!r}")
        if kind == "Path":
            object.__setattr__(config, item.name, Path(str(value)))
        if kind in ("str", "Path"):
            _check_text(item.name, str(value), expected)


def _check_text(name: str, value: str, expected: str) -> None:
    """No file and no name is any longer, and the system takes no NUL."""
    if not value:
        refuse(f"{name}: expected {expected}, got an empty one")
    if len(value) > LONGEST or "\0" in value:
        refuse(f"{name}: expected {expected} of up to {LONGEST} characters, got {value[:40]!r}...")


def _check_counts(config: RunConfig) -> None:
    for name in ("seed", "storey"):
        value = getattr(config, name)
        if value is not None and value < 0:
            refuse(f"{name}: expected 0 or more, got {value}")


def _check_positive(config: RunConfig) -> None:
    for name, unit in (("duration", "seconds"), ("speed", "m/s")):
        value = getattr(config, name)
        if value is not None and not 0.0 < value < MOST:
            refuse(f"{name}: expected {unit} above 0 and below {MOST:g}, got {value}")
    if config.duration is not None and config.duration < SWEEP:
        refuse(f"duration: expected one sweep at least, {SWEEP:g} seconds, got {config.duration}")


def slug(name: str) -> str:
    """A name as a part of a folder's name."""
    return re.sub(r"[^A-Za-z0-9._+-]+", "-", name).strip("-.") or "scene"
