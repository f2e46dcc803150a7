"""rooms.csv: what became of every true room, and which detections are false, by name."""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from eval.files import check, read_csv, write_text
from eval.scenegraph import node_id
from eval.score.failures import Fates
from worlds.truth import Truth

ROOMS_FILE = "rooms.csv"

FOUND, MISSED, NOT_ENTERED, FALSE = STATES = ("found", "missed", "not entered", "false")


@dataclass(frozen=True)
class RoomRow:
    """room: a true room's name, empty where a false detection is about none; state: one of
    ``STATES``; detection: its node in graph.json, empty where there is none; cause: the stage that
    had a missed or false room wrong (``score.failures``), else empty."""

    room: str
    state: str
    detection: str = ""
    cause: str = ""


COLUMNS = tuple(item.name for item in fields(RoomRow))


def room_rows(fates: Fates | None, truth: Truth, entered: Collection[int]) -> list[RoomRow]:
    """Every true room in the truth's order, then the false detections; nothing where rooms are not
    scored. entered: room ids."""
    if fates is None:
        return []
    missed = {fault.room: fault.cause for fault in fates.faults if fault.proposal is None}
    rows = []
    for room in truth.rooms:
        if room.id in fates.found:
            rows.append(RoomRow(room.name, FOUND, node_id("room", fates.found[room.id])))
        elif room.id in entered:
            rows.append(RoomRow(room.name, MISSED, cause=missed[room.id]))
        else:
            rows.append(RoomRow(room.name, NOT_ENTERED))
    for fault in fates.faults:
        if fault.proposal is not None:
            name = "" if fault.room is None else truth.rooms[fault.room].name
            rows.append(RoomRow(name, FALSE, node_id("room", fault.proposal), fault.cause))
    return rows


def write_rooms(rows: Sequence[RoomRow], path: Path) -> None:
    """Write the table, whole or not at all."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(COLUMNS)
    table.writerows(map(astuple, rows))
    write_text(path, text.getvalue())


def read_rooms(path: Path) -> list[RoomRow]:
    """Read the table. Raises InputError."""
    lines = read_csv(path)
    check(lines[:1] == [list(COLUMNS)], path, "line 1", ",".join(COLUMNS))
    for number, line in enumerate(lines[1:], start=2):
        good = len(line) == len(COLUMNS) and line[1] in STATES
        check(good, path, f"line {number}", f"{len(COLUMNS)} fields, state: {', '.join(STATES)}")
    return [RoomRow(*line) for line in lines[1:]]
