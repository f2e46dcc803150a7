"""IFC files that are broken or made to harm: a building, or one line, in bounded time."""

from __future__ import annotations

import re
from pathlib import Path

import buildings
import numpy as np
import pytest
from spoil import spoilt

from slam.core import InputError
from worlds.readers import read_building

pytest.importorskip("ifcopenshell", reason="needs the extra ifc")

END = "ENDSEC;\nEND-ISO"
SOLID = r"(#\d+)=IFCEXTRUDEDAREASOLID\(.*\);"
PLACED = r"(#\d+)=IFCLOCALPLACEMENT\(([^,]*),"
CONVERTED = (
    "#7000=IFCDIMENSIONALEXPONENTS(1,0,0,0,0,0,0);\n#7001=IFCMEASUREWITHUNIT(IFCLENGTHMEASURE({}),"
    "#7002);\n#7002=IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.);"
)

CRAFTED = {
    "placements in a circle": (PLACED, r"\1=IFCLOCALPLACEMENT(\1,"),
    "a solid of itself": (SOLID, r"\1=IFCBOOLEANRESULT(.UNION.,\1,\1);"),
    "a solid of a wall": (r"IFCPOLYLINE\(\((#\d+)", r"IFCPOLYLINE((#1"),
    "profiles that are not there": (
        r"IFCEXTRUDEDAREASOLID\(#\d+",
        "IFCEXTRUDEDAREASOLID(#99999999",
    ),
    "a direction without length": (r"\(\(0\.,0\.,1\.\)\)", "((0.,0.,0.))"),
    "coordinates of 1e308": (r"\(8\.1,", "(1.E308,"),
    "coordinates that are NaN": (r"\(8\.1,", "(NAN,"),
    "heights of 1e300": (r"(IFCEXTRUDEDAREASOLID\(.*),[\d.]+\);", r"\1,1.E300);"),
    "walls in nothing": (r"(IFCRELCONTAINEDINSPATIALSTRUCTURE\(.*),#\d+\);", r"\1,$);"),
    "holes in nothing": (r"(IFCRELVOIDSELEMENT\(.*),#\d+,#\d+\);", r"\1,$,$);"),
    "triangles of no points": (
        SOLID,
        r"\1=IFCTRIANGULATEDFACESET(#7000,$,.T.,((1,2,99999999),(-5,0,1)),$);\n"
        r"#7000=IFCCARTESIANPOINTLIST3D(((0.,0.,0.),(1.,0.,0.),(0.,1.,0.)));",
    ),
    "brackets without end": (r"IFCPOLYLINE\(\(", "IFCPOLYLINE(" + "(" * 100_000),
    "a name of another alphabet": ("'office'", "'b\u00fcro \U0001f3e0 \\\\X2\\\\00E9\\\\X0\\\\'"),
}
"""What is replaced in the valid file, and by what."""


def bear(path: Path, content: str | bytes) -> str:
    """What is said of a file that is refused; nothing of one that is read."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    said = refusal(path)
    assert "\n" not in said
    assert not said or path.name in said
    return said


def refusal(path: Path) -> str:
    try:
        read_building(path)
    except InputError as refused:
        return str(refused)
    return ""


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("worlds.readers.ifcprocess.PATIENCE", 8.0)


@pytest.mark.usefixtures("impatient")
@pytest.mark.parametrize("name", CRAFTED)
def test_what_is_made_to_harm_is_read_or_refused_in_one_line(name: str, tmp_path: Path) -> None:
    path = buildings.ifc(tmp_path)
    whole, (found, other) = path.read_text(), CRAFTED[name]
    crafted = re.sub(found, other, whole)
    assert crafted != whole
    said = bear(path, crafted)
    assert "NoneType" not in said


@pytest.mark.usefixtures("impatient")
def test_spoilt_files_are_read_or_refused_in_one_line(tmp_path: Path) -> None:
    path = buildings.ifc(tmp_path)
    whole, rng = path.read_bytes(), np.random.default_rng(3)
    for _ in range(8):
        bear(path, spoilt(whole, rng))


@pytest.mark.parametrize(
    ("schema", "expected"), [("IFC4X3", "expected IFC2x3 or IFC4"), ("AP214", "expected IFC2x3")]
)
def test_another_schema_is_named(schema: str, expected: str, tmp_path: Path) -> None:
    path = buildings.ifc(tmp_path)
    said = bear(path, path.read_text().replace("('IFC4')", f"('{schema}')"))
    assert expected in said
    assert schema in said


def test_an_empty_file(tmp_path: Path) -> None:
    assert "found an empty file" in bear(tmp_path / "building.ifc", b"")


@pytest.mark.parametrize("length", ["0.", "-1."])
def test_a_unit_of_no_length_is_refused(length: str, tmp_path: Path) -> None:
    path = buildings.ifc(tmp_path)
    foot = "IFCCONVERSIONBASEDUNIT(#7000,.LENGTHUNIT.,'x',#7001);"
    text = re.sub(r"IFCSIUNIT\(.*LENGTHUNIT.*\);", foot, path.read_text())
    said = bear(path, text.replace(END, CONVERTED.format(length) + "\n" + END))
    assert "IfcUnitAssignment: expected a unit of length" in said


def test_the_parser_gets_no_more_memory_than_it_may(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("worlds.readers.ifcprocess.MEMORY", 150_000_000)
    path = buildings.ifc(tmp_path)
    assert "expected sound IFC" in bear(path, path.read_bytes())
