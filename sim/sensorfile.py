"""Sensors as TOML files: the presets that ship, and a user's own.

Keys are the fields of ``Sensor``, with their unit where they have one. One number in place of a
table holds for every beam; ``based_on`` names the preset whose values stand where a file gives
none; ``source`` says where the numbers are from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np

from sim.sensor import Sensor
from slam.core import InputError
from worlds.fields import read_toml
from worlds.names import unknown

PRESETS = Path(__file__).parent / "sensors"

TABLES: Mapping[str, tuple[str, float]] = {
    "elevations_deg": ("elevations", np.pi / 180.0),
    "azimuth_offsets_deg": ("azimuth_offsets", np.pi / 180.0),
    "firing_offsets_us": ("firing_offsets", 1e-6),
    "range_offsets_mm": ("range_offsets", 1e-3),
    "range_noise_mm": ("range_noise", 1e-3),
    "dropout": ("dropout", 1.0),
}
"""Key -> field with one entry a beam, and the factor to the field's unit."""

NUMBERS: Mapping[str, tuple[str, float]] = {
    "columns": ("columns", 1),
    "rate_hz": ("rate", 1.0),
    "min_range_m": ("min_range", 1.0),
    "max_range_m": ("max_range", 1.0),
    "range_step_mm": ("range_step", 1e-3),
    "grazing": ("grazing", 1.0),
    "divergence_mrad": ("divergence", 1e-3),
    "glass": ("glass", 1.0),
    "glass_mirror": ("glass_mirror", 1.0),
}
FLAGS = ("random_phase", "clockwise")
TEXTS = ("based_on", "source")


def sensor_names() -> tuple[str, ...]:
    """The presets."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.toml")))


def sensor_named(name: str) -> Sensor:
    """The preset of that name, or the sensor in a file NAME.toml.

    Raises InputError: with the nearest names, or with what is wrong with the file.
    """
    if name.endswith(".toml"):
        return read_sensor(Path(name))
    if name not in sensor_names():
        raise InputError(unknown("sensor", name, sensor_names()))
    return _preset(name)


@cache
def _preset(name: str) -> Sensor:
    return read_sensor(PRESETS / f"{name}.toml")


def read_sensor(path: Path) -> Sensor:
    """The sensor in a TOML file; its name is the file's. Raises InputError."""
    values = read_toml(path)
    known = (*TABLES, *NUMBERS, *FLAGS, *TEXTS)
    for key in values.keys() - set(known):
        raise InputError(f"sensor {path}: unknown key {key}, expected {', '.join(known)}")
    try:
        return _sensor(path.stem, values)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _sensor(name: str, values: Mapping[str, object]) -> Sensor:
    found: dict[str, object] = {}
    if "based_on" in values:
        preset = sensor_named(str(values["based_on"]))
        found = {item.name: getattr(preset, item.name) for item in fields(preset)}
    elevations = values.get("elevations_deg", found.get("elevations", ()))
    beams = len(elevations) if isinstance(elevations, list | tuple) else 1
    for key, value in values.items():
        if key in TABLES:
            field, unit = TABLES[key]
            entries = value if isinstance(value, list) else [value] * beams
            found[field] = tuple(unit * _number(key, entry) for entry in entries)
        elif key in NUMBERS:
            field, unit = NUMBERS[key]
            found[field] = unit * _number(key, value)
        elif key in FLAGS:
            found[key] = _flag(key, value)
    for key, (field, _) in TABLES.items():
        if field not in found:
            raise InputError(f"{key}: missing, expected one number a beam or one for all")
    found["name"] = name
    return Sensor(**found)  # type: ignore[arg-type]  # their types were checked one by one


def _number(key: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key}: expected a number, got {value!r}")
    if key == "columns" and not isinstance(value, int):
        raise InputError(f"{key}: expected a whole number, got {value!r}")
    return value


def _flag(key: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise InputError(f"{key}: expected true or false, got {value!r}")
    return value
