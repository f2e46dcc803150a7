"""What the yaml of a ROS occupancy map says, checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from shapely import affinity
from shapely.geometry.base import BaseGeometry

from slam.core import InputError
from worlds.fields import Field

REQUIRED = ("image", "resolution", "origin")
OCCUPIED, FREE = 0.65, 0.196
"""map_server's thresholds where the file gives none."""
MAX_DEPTH = 5
"""Deepest nesting of the yaml."""


@dataclass(frozen=True)
class MapFile:
    """What the yaml says. resolution: [m/pixel]; origin: x, y [m], yaw [rad]."""

    path: Path
    image: Path
    labels: Path | None
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied: float
    free: float

    def placed(self, shape: BaseGeometry) -> BaseGeometry:
        """A shape in pixels, in metres in the map's frame."""
        x, y, yaw = self.origin
        c, s = self.resolution * math.cos(yaw), self.resolution * math.sin(yaw)
        return affinity.affine_transform(shape, [c, -s, s, c, x, y])

    @property
    def files(self) -> tuple[Path, ...]:
        """The yaml and its images."""
        return (self.path, self.image, *([self.labels] if self.labels else []))


def read_map_file(path: Path) -> MapFile:
    root = Field(str(path), "", _yaml(path))
    if not isinstance(root.value, dict) or not all(isinstance(k, str) for k in root.value):
        root.wrong("a map: image, resolution and origin")
    for key in REQUIRED:
        if key not in root.value:
            root.fail(f'the field "{key}" is missing')
    parts = {key: Field(str(path), key, value) for key, value in root.value.items()}
    origin = [item.number() for item in parts["origin"].items()]
    if len(origin) != 3:
        parts["origin"].wrong("three numbers: x, y and yaw")
    occupied, free = _share(parts, "occupied_thresh", OCCUPIED), _share(parts, "free_thresh", FREE)
    if free > occupied:
        parts["free_thresh"].wrong(f"at most occupied_thresh {occupied:g}")
    return MapFile(
        path=path,
        image=_beside(path, parts["image"]),
        labels=_beside(path, parts["labels"]) if "labels" in parts else None,
        resolution=parts["resolution"].positive(),
        origin=(origin[0], origin[1], origin[2]),
        negate=_flag(parts, "negate"),
        occupied=occupied,
        free=free,
    )


def _beside(path: Path, field: Field) -> Path:
    """A file in the folder of the yaml: a map that somebody sent opens no others."""
    name = field.text()
    folder = path.parent.resolve()
    if "\0" in name or not (folder / name).resolve().is_relative_to(folder):
        field.wrong("a file in the same folder")
    return path.parent / name


def _share(parts: dict[str, Field], key: str, otherwise: float) -> float:
    if key not in parts:
        return otherwise
    value = parts[key].number()
    if not 0.0 <= value <= 1.0:
        parts[key].wrong("a number from 0 to 1")
    return value


def _flag(parts: dict[str, Field], key: str) -> bool:
    if key in parts and parts[key].value not in (0, 1):
        parts[key].wrong("0 or 1")
    return bool(key in parts and parts[key].value)


def _yaml(path: Path) -> object:
    import yaml

    try:
        text = path.read_text(encoding="utf-8-sig")
        depth = 0
        for event in yaml.parse(text, yaml.SafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if isinstance(event, yaml.AliasEvent) or depth > MAX_DEPTH:
                raise InputError(
                    f"{path}: expected the yaml of a ROS map, found aliases or deep nesting"
                )
        return yaml.safe_load(text)
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected yaml in UTF-8: {error.reason}") from error
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise InputError(f"{path}: expected the yaml of a ROS map: {reason}") from error
