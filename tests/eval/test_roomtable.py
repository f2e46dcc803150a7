"""What became of the rooms, by name, and the table of it."""

from __future__ import annotations

from pathlib import Path

from eval.roomtable import RoomRow, read_rooms, room_rows, write_rooms
from eval.score.failures import Fates, Fault


def test_every_room_has_one_row_and_so_has_every_false_detection(house) -> None:
    faults = (Fault(1, None, "edges"), Fault(1, 4, "planes"), Fault(None, 6, "clustering"))
    rows = room_rows(Fates({0: 3}, faults), house.truth, entered={0, 1})
    assert rows == [
        RoomRow("A", "found", "r3"),
        RoomRow("B", "missed", cause="edges"),
        RoomRow("C", "not entered"),
        RoomRow("B", "false", "r4", "planes"),
        RoomRow("", "false", "r6", "clustering"),
    ]
    assert room_rows(None, house.truth, entered={0}) == []


def test_round_trip(tmp_path: Path) -> None:
    rows = [RoomRow('a, "b"\u00e9', "missed", "", "edges"), RoomRow("", "false", "r1", "unseen")]
    write_rooms(rows, tmp_path / "rooms.csv")
    assert read_rooms(tmp_path / "rooms.csv") == rows
