"""Files that are made to harm: each kind of harm once, refused in one line, and at once."""

from __future__ import annotations

import contextlib
import io
import json
import sqlite3
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from kinds import KINDS, Kind

from slam.core import InputError


class Armed:
    """Fails the test where it is unpickled."""

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return pytest.fail, ("it was unpickled",)


# --- the files --------------------------------------------------------------------------------


def plan(**storey: object) -> bytes:
    room, wall = [[0, 0], [4, 0], [4, 3]], [[-1, -1], [5, -1], [5, 0], [-1, 0]]
    whole = {"rooms": [{"outline": room}], "walls": [{"outline": wall}]} | storey
    return json.dumps({"format": "roomloop-plan-1", "storeys": [whole]}).encode()


def glb(**parts: object) -> bytes:
    text = json.dumps({"asset": {"version": "2.0"}} | parts).encode()
    text += b" " * (-len(text) % 4)
    chunk = struct.pack("<II", len(text), 0x4E4F534A) + text
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunk)) + chunk


def npz(header: str) -> bytes:
    """Every array of a file has this header, and no content."""
    out = io.BytesIO()
    array = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode()
    with zipfile.ZipFile(out, "w") as archive:
        for name in ("config", "header", "stamps"):
            archive.writestr(f"{name}.npy", array)
    return out.getvalue()


def armed() -> bytes:
    out = io.BytesIO()
    np.savez(out, allow_pickle=True, config=np.array([Armed()], object), header=np.array([Armed()]))
    return out.getvalue()


def pcd(packed: int, unpacked: int) -> bytes:
    head = (
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {0}\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA binary_compressed\n"
    )
    body = struct.pack("<II", packed, unpacked) + b"\xff" * packed
    return head.format(unpacked // 12).encode() + body


def changed(kind: str, old: str, new: str) -> Callable[[Path], bytes]:
    """A valid file with one text of it replaced."""

    def make(path: Path) -> bytes:
        text = path.read_text()
        assert old in text
        return text.replace(old, new).encode()

    return make


def damaged_transforms(path: Path) -> bytes:
    """A ROS 2 bag that is whole but for its static transforms."""
    with contextlib.closing(sqlite3.connect(path)) as bag, bag:
        columns = [row[1] for row in bag.execute("PRAGMA table_info(topics)")]
        topic = {"id": 99, "name": "/tf_static", "type": "tf2_msgs/msg/TFMessage"}
        topic["serialization_format"] = "cdr"
        values = [topic.get(column, "") for column in columns]
        bag.execute(f"INSERT INTO topics VALUES ({','.join('?' * len(values))})", values)
        bag.execute("INSERT INTO messages (topic_id, timestamp, data) VALUES (99, 1, x'0001')")
    return path.read_bytes()


HALF = '"\\ud800"'
ROOMS = [{"id": str(n), "outline": [[0, 0], [4, 0], [4, 3]]} for n in range(6000)]
CHAIN = [{"children": [n + 1]} for n in range(5000)]
ZEROS = [{"componentType": 5126, "count": 10**9, "type": "VEC3"}]

CRAFTED: list[tuple[str, bytes | Callable[[Path], bytes], str]] = [
    ("plan", plan(rooms=ROOMS), "at most 5000, found 6000"),
    ("plan", plan(rooms=ROOMS[:4000]), "overlap, expected rooms side by side"),
    ("plan", plan(doors=[{}] * 6000), "at most 5000, found 6000"),
    ("plan", plan(walls=[[]] * 2_000_001), "JSON of at most 2000000 values"),
    ("plan", b'{"format": "roomloop-plan-1", "building": "%s"}' % (b"x" * 5000), "building"),
    ("plan", plan(name="x").replace(b'"x"', HALF.encode()), "whole letters, found half"),
    ("floor plan", b'{"storeys": [%s{}]}' % (b"{}," * 300), "at most 200, found 301"),
    ("graph", changed("graph", '"r0"', HALF), "whole letters, found half"),
    ("graph", changed("graph", "4.0", "1e200"), "finite numbers"),
    ("metrics", changed("metrics", '"seed": 3', '"seed": 1' + "0" * 400), "seed: 1000"),
    ("rooms", b'{"rooms": [{"polygon": [[0, 0], [1e300, 0], [1e300, 1e300]]}]}', "finite numbers"),
    ("rooms", b'{"rooms": [%s{}]}' % (b"{}," * 20_000), "at most 20000"),
    ("dsg", changed("dsg", '"source": 2', '"source": [2]'), "ids of two nodes"),
    ("map", changed("map", "image:", "2001-01-01: 1\nimage:"), "expected a map"),
    ("obj", b"v 0 0 0\nv 1e308 0 0\nv 0 -1e308 0\nf 1 2 3\n", "would measure 1e.308 x"),
    ("glb", glb(accessors=ZEROS), "at most 20000000 elements"),
    ("glb", glb(accessors=[{"count": -1}]), "expected a count"),
    ("glb", glb(nodes=[{"children": [0]}]), "found one without end"),
    ("glb", glb(nodes=CHAIN), "found one without end"),
    ("cloud pcd", pcd(100, 3_900_000_000), "bytes, packed"),
    ("scenario", b'scene = "SE1"\nduration = 0x' + b"f" * 9000, "whole numbers of 64 bits"),
    ("scenario", b"a." * 2000 + b"a = 1", "more than 500 dots"),
    ("scenario", b'scene = "SE1"\nseeds = [%s]' % (b"1," * 9000), r"got \[1, 1, .{,40}\.\.\.$"),
    ("ablation table", b"x" * 200_000, "a table .CSV. was expected"),
    ("db3", damaged_transforms, "/tf_static: cannot be taken apart"),
    ("trajectory", b"1_0 0 0 0 0 0 0 1\n", "8 numbers"),
    ("trajectory", b"1 " * 100_000, "line 1: 8"),
    ("labels", armed(), "Object arrays cannot be loaded"),
    ("weights", armed(), "Object arrays cannot be loaded"),
    ("labels", npz("{'descr':" + "(" * 9000 + "}\n"), "expected labels"),
    ("weights", npz("{'descr':" + "(" * 9000 + "}\n"), "expected weights"),
    ("labels", npz("{'descr':'<f8','fortran_order':False,'shape':(10**12,)}\n"), "expected labels"),
    ("labels", npz("{'descr':'<f8','fortran_order':False,'shape':(9999999999999,)}\n"), "allocate"),
]


def name_of(case: object) -> str | None:
    return case if isinstance(case, str) else "content"


@pytest.mark.parametrize(("name", "content", "expected"), CRAFTED, ids=name_of)
def test_it_is_refused_in_one_line(
    name: str, content: bytes | Callable[[Path], bytes], expected: str, tmp_path: Path
) -> None:
    kind: Kind = KINDS[name]
    path = kind.make(tmp_path)
    path.write_bytes(content if isinstance(content, bytes) else content(path))
    with pytest.raises(InputError, match=expected) as refused:
        kind.read(path)
    assert "\n" not in str(refused.value)
