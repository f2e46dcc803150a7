"""Scenario files: a run, its seeds, and the bounds that its metrics have to keep (TOML)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import NoReturn

from eval.comparing.bounds import Bound, parse_bound
from eval.config import LONGEST, RunConfig, slug
from eval.names import refuse
from slam.core import InputError
from worlds.catalogue import scene_names
from worlds.fields import read_toml, shown
from worlds.names import unknown

SHIPPED = Path(__file__).parent / "scenarios"
"""The sets that come with roomloop: ``smoke`` and ``full``."""

NOT_IN_FILES = ("out", "cache")
"""Fields of RunConfig that a scenario file does not set: they belong to whoever runs it."""
BESIDE_THE_RUN = ("seeds", "expect", "markers", "description")
"""Keys beside those of RunConfig. pytest reads markers; people read description."""
MAX_SEEDS = 10_000


@dataclass(frozen=True)
class Scenario:
    """name: for people and for the folder; config: of the first run; seeds: one run each, which
    differs from the first in nothing else; bounds: what has to hold of them."""

    name: str
    config: RunConfig
    seeds: tuple[int, ...]
    bounds: tuple[Bound, ...] = ()

    @property
    def folder(self) -> Path:
        """Where it writes: ``out``, or a folder of its name under ``runs``."""
        return self.config.out or Path("runs") / slug(self.name)

    @property
    def runs(self) -> tuple[RunConfig, ...]:
        """One configuration a seed: in the folder itself if it is the only one, else in its sN."""
        if len(self.seeds) == 1:
            return (replace(self.config, seed=self.seeds[0], out=self.folder),)
        return tuple(
            replace(self.config, seed=seed, out=self.folder / f"s{seed}") for seed in self.seeds
        )


def is_scenario(argument: str) -> bool:
    """Does the command line mean a scenario file?"""
    return argument.endswith(".toml")


def scenario_path(argument: str) -> Path:
    """The file behind a path, or behind the name of one that ships (``smoke/SE1.toml``)."""
    path = Path(argument)
    if path.is_file():
        return path
    if (SHIPPED / path).is_file():
        return SHIPPED / path
    names = [file.relative_to(SHIPPED).as_posix() for file in sorted(SHIPPED.glob("*/*.toml"))]
    refuse(f"{argument}: no such file, and {unknown('scenario', argument, names)}")


def read_scenario(argument: str, **flags: object) -> Scenario:
    """A scenario by its path or name; flags (fields of RunConfig) override it. Raises InputError.

    A flag ``seed`` stands for all seeds of the file.
    """
    path = scenario_path(argument)
    values = _table(path)
    bounds = _bounds(path, values.pop("expect", {}))
    for key in ("markers", "description"):
        values.pop(key, None)
    seeds = _seeds(path, values)
    if "seed" in flags:
        seeds = (flags["seed"],)  # type: ignore[assignment]  # RunConfig checks it
    values["scene"] = _scene(path, values.get("scene"))
    try:
        config = RunConfig(**(values | flags | {"seed": seeds[0]}))  # type: ignore[arg-type]
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    return Scenario(
        path.name.removesuffix(".toml").removesuffix(".scenario"), config, seeds, bounds
    )


def _table(path: Path) -> dict[str, object]:
    values = read_toml(path)
    names = [item.name for item in fields(RunConfig) if item.name not in NOT_IN_FILES]
    known = (*names, *BESIDE_THE_RUN)
    for key in values:
        if key not in known:
            refuse(f"{path}: {unknown('key', key, known)}")
    return values


def _scene(path: Path, scene: object) -> str:
    """A catalogue name as it is; a path as one from the working folder."""
    if not isinstance(scene, str) or not 0 < len(scene) < LONGEST:
        refuse(f"{path}: scene: expected a name of the catalogue or a path, got {shown(scene)}")
    if scene in scene_names():
        return scene
    beside = path.parent / scene
    is_path = beside.exists() or Path(scene).suffix or len(Path(scene).parts) > 1
    return str(beside) if is_path else scene


def _seeds(path: Path, values: dict[str, object]) -> tuple[int, ...]:
    """Takes ``seeds``, or the one ``seed``, out of the values."""
    if "seeds" in values and "seed" in values:
        refuse(f"{path}: seeds: expected seed or seeds, found both")
    seeds = values.pop("seeds", [values.pop("seed", 0)])
    if not isinstance(seeds, list) or not all(type(s) is int and s >= 0 for s in seeds):
        _refuse_seeds(path, seeds)
    if not seeds or len(set(seeds)) < len(seeds):
        _refuse_seeds(path, seeds)
    return tuple(seeds)


def _refuse_seeds(path: Path, seeds: object) -> NoReturn:
    found = shown(seeds)
    refuse(f"{path}: seeds: expected different whole numbers from 0, as [0, 1, 2], got {found}")


def _bounds(path: Path, table: object) -> tuple[Bound, ...]:
    if not isinstance(table, Mapping):
        refuse(f'{path}: expect: expected a table, as [expect] and ate_m = "<= 0.04": {table!r}')
    return tuple(parse_bound(str(path), key, text) for key, text in _flat(table, ""))


def _flat(table: Mapping[str, object], prefix: str) -> Iterator[tuple[str, object]]:
    """A dotted key that lacks its quotes comes as a table in the table."""
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


# --- from flags -----------------------------------------------------------------------------------


def of_flags(config: RunConfig, seeds: tuple[int, ...]) -> Scenario:
    """A configuration with several seeds, and no bounds."""
    stem = Path(config.scene).stem
    return Scenario(f"{slug(stem)}-{slug(config.detector)}", config, seeds)


def parse_seeds(text: str) -> tuple[int, ...]:
    """``0,1,2``, ``0-9`` and mixtures of both. Raises InputError."""
    seeds: list[int] = []
    for part in text.split(","):
        found = re.fullmatch(r"\s*(\d{1,9})(?:\s*-\s*(\d{1,9}))?\s*", part)
        if found is None:
            refuse(f"seeds: expected numbers as 0,1,2 or 0-9, got {text!r}")
        first, last = int(found[1]), int(found[2] or found[1])
        if last - first >= MAX_SEEDS:
            refuse(f"seeds: expected at most {MAX_SEEDS}, got {text!r}")
        seeds += range(first, last + 1)
    if not seeds or len(set(seeds)) < len(seeds):
        refuse(f"seeds: expected different numbers, as 0,1,2 or 0-9, got {text!r}")
    return tuple(seeds)
