"""Members of JSON objects that may carry more than we know."""

from __future__ import annotations

from worlds.fields import Field


def member(field: Field, key: str) -> Field:
    """A member that must be there; others may stand beside it."""
    if _missing(field, key):
        field.fail(f'the field "{key}" is missing')
    assert isinstance(field.value, dict)
    return Field(field.file, f"{field.path}.{key}" if field.path else key, field.value[key])


def members(field: Field, key: str) -> list[Field]:
    """The elements of a member that may be left out or null."""
    return [] if _missing(field, key) else member(field, key).items()


def number(field: Field, key: str, otherwise: float) -> float:
    """A member that may be left out or null."""
    return otherwise if _missing(field, key) else member(field, key).number()


def text(field: Field, key: str) -> str:
    """A member that may be left out or null, then empty; a number is taken as it is written."""
    if _missing(field, key):
        return ""
    found = member(field, key)
    return str(found.value) if isinstance(found.value, int) else found.text().strip()


def _missing(field: Field, key: str) -> bool:
    if not isinstance(field.value, dict):
        field.wrong("an object")
    return field.value.get(key) is None
