"""Files of JSON and TOML, and a value in one that knows where it stands, for errors to name."""

from __future__ import annotations

import difflib
import json
import math
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from slam.core import InputError
from slam.plainfile import size_of

MAX_BYTES = 50_000_000
"""Largest plan file that is read [bytes]: a building of 1,000 rooms takes well under 5 MB."""
MAX_TOML = 1_000_000
"""Largest TOML file that is read [bytes]; people write them."""
MAX_DOTS = 500
"""Most dots in a line of one: the parser takes the square of a key's parts."""
MAX_VALUES = 2_000_000
"""Most values in it; a million empty lists take a gigabyte."""
MAX_COORDINATE = 100_000.0
"""Largest length or coordinate that a building can have [m]."""
SHOWN = 40
"""Characters of a wrong value that an error shows."""


@dataclass(frozen=True)
class Field:
    """One value of a parsed JSON file, its path there (``storeys[0].rooms[3].outline``)."""

    file: str
    path: str
    value: object

    def fail(self, expected: str) -> NoReturn:
        """Raises the InputError that names file, field and what was expected."""
        where = f"{self.file}: {self.path}" if self.path else self.file
        raise InputError(f"{where}: {expected}")

    def wrong(self, expected: str) -> NoReturn:
        """``fail`` for a value of the wrong kind, which it shows."""
        self.fail(f"expected {expected}, found {shown(self.value)}")

    def members(self, required: tuple[str, ...], optional: tuple[str, ...]) -> dict[str, Field]:
        """An object's fields by name; every name must be known and each required one present."""
        if not isinstance(self.value, dict):
            self.wrong("an object")
        for key in self.value:
            if key not in required and key not in optional:
                self._unknown(key, required + optional)
        for key in required:
            if key not in self.value:
                self.fail(f'the field "{key}" is missing')
        return {key: self.member(key) for key in self.value}

    def has(self, key: str) -> bool:
        """Whether it is an object that has this field."""
        return isinstance(self.value, dict) and key in self.value

    def member(self, key: str) -> Field:
        """A field that the object has."""
        assert isinstance(self.value, dict)
        return Field(self.file, f"{self.path}.{key}" if self.path else key, self.value[key])

    def _unknown(self, key: str, known: tuple[str, ...]) -> NoReturn:
        near = difflib.get_close_matches(key, known, n=1)
        hint = f'did you mean "{near[0]}"?' if near else f"known are {', '.join(known)}"
        self.fail(f"unknown field {shown(key)}: {hint}")

    def items(self, most: int | None = None) -> list[Field]:
        """The elements of a list, which has no more than ``most``."""
        if not isinstance(self.value, list):
            self.wrong("a list")
        if most is not None and len(self.value) > most:
            self.fail(f"expected at most {most}, found {len(self.value)}")
        return [Field(self.file, f"{self.path}[{i}]", v) for i, v in enumerate(self.value)]

    def text(self) -> str:
        """A text."""
        if not isinstance(self.value, str):
            self.wrong("a text")
        return self.value

    def choice(self, known: tuple[str, ...]) -> str:
        """One of some words."""
        if self.value not in known:
            self.wrong(f"one of {', '.join(known)}")
        return str(self.value)

    def truth(self) -> bool:
        """True or false."""
        if not isinstance(self.value, bool):
            self.wrong("true or false")
        return self.value

    def number(self) -> float:
        """A finite number of plausible size."""
        if isinstance(self.value, bool) or not isinstance(self.value, (int, float)):
            self.wrong("a number")
        if isinstance(self.value, float) and not math.isfinite(self.value):
            self.wrong("a finite number")
        if abs(self.value) > MAX_COORDINATE:
            self.wrong(f"metres within +-{MAX_COORDINATE:.0f}")
        return float(self.value)

    def whole(self) -> int:
        """A whole number."""
        if isinstance(self.value, bool) or not isinstance(self.value, int):
            self.wrong("a whole number")
        return self.value

    def positive(self) -> float:
        """A number above zero."""
        number = self.number()
        if number <= 0.0:
            self.wrong("a number above 0")
        return number

    def point(self) -> tuple[float, float]:
        """A point ``[x, y]``."""
        if not isinstance(self.value, list) or len(self.value) != 2:
            self.wrong("a point [x, y]")
        x, y = self.items()
        return x.number(), y.number()


def shown(value: object) -> str:
    """A value as an error quotes it: on one line, and short."""
    try:
        text = json.dumps(value, ensure_ascii=True, default=str)
    except (TypeError, RecursionError):  # a key that JSON does not have, from yaml
        text = ascii(type(value).__name__)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def read_json(path: Path) -> Field:
    """The root of a JSON file. Raises InputError for what cannot be read, or is not JSON."""
    return Field(str(path), "", parsed_json(path, read_utf8(path, MAX_BYTES), MAX_VALUES))


def read_utf8(path: Path, most: int) -> str:
    """A text file of at most so many bytes. Raises InputError."""
    size = size_of(path)
    if size > most:
        raise InputError(f"{path}: {size / 1e6:.0f} MB, expected at most {most / 1e6:.0f} MB")
    try:
        return path.read_text(encoding="utf-8-sig")
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: expected text in UTF-8: {error.reason}") from error


def parsed_json(path: Path, text: str, most: int) -> object:
    """What a text of JSON says; most: values in it; path: for errors. Raises InputError."""
    if text.count(",") > most:  # before each of them takes a hundred bytes
        raise InputError(f"{path}: expected JSON of at most {most} values")
    try:
        tree = json.loads(text, object_pairs_hook=_unique)
        if "\\ud" in text or "\\uD" in text:
            json.dumps(tree, ensure_ascii=False).encode()
        return tree
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise InputError(f"{path}: expected JSON: {error.msg} at {where}") from error
    except RecursionError as error:
        raise InputError(f"{path}: expected JSON, found one nested too deeply") from error
    except UnicodeEncodeError as error:  # it could be read, and never be written
        raise InputError(f"{path}: expected JSON of whole letters, found half of one") from error
    except ValueError as error:  # a field that stands twice, a number of 5,000 digits
        raise InputError(f"{path}: expected JSON: {error}") from error


def read_toml(path: Path) -> dict[str, object]:
    """A TOML file. Raises InputError for what cannot be read, or is not TOML."""
    text = read_utf8(path, MAX_TOML)
    if any(line.count(".") > MAX_DOTS for line in text.splitlines()):
        raise InputError(f"{path}: expected TOML of shorter lines, found more than {MAX_DOTS} dots")
    try:
        tree = tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"{path}: expected TOML, found one nested too deeply") from error
    except ValueError as error:
        raise InputError(f"{path}: expected TOML: {error}") from error
    if any(isinstance(value, int) and value.bit_length() > 63 for value in _leaves(tree)):
        raise InputError(f"{path}: expected TOML with whole numbers of 64 bits, found larger ones")
    return tree


def _leaves(tree: object) -> Iterator[object]:
    """What is neither a table nor a list, at any depth."""
    pending = [tree]
    while pending:
        value = pending.pop()
        if isinstance(value, dict | list):
            pending.extend(value.values() if isinstance(value, dict) else value)
        else:
            yield value


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    """A JSON object; a field named twice is a slip that would silently lose one of them."""
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"the field {shown(twice)} stands twice in one object")
    return found
