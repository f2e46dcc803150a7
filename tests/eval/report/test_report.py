"""The page of a run: whole in itself, readable by machines and people, true to the files."""

from __future__ import annotations

import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from eval.graphfile import PlaneNode, RoomNode, SceneGraph, write_graph
from eval.outputs import write_tum
from eval.report import html, svg
from eval.report.ablation import ablation_page, write_ablation
from eval.report.run import leaves, number, read_run, run_page, write_report
from eval.score.trajectory import Trajectory
from slam.core import InputError, pose

NASTY = '<script>alert("&")</script>'
METRICS = {
    "schema": "roomloop-1",
    "status": "complete",
    "error": None,
    "simulated_s": 5.0,
    "ate_m": 0.123,
    "T_world_map": [[1.0]],
    "rooms": {"entered": 4, "recall": 0.75, "precision": 0.5},
    "stages": {
        "odometry": {"median_ms": 20.0, "p95_ms": 31.0, "total_s": 1.0},
        "graph": {"median_ms": None, "p95_ms": None, "total_s": None},
    },
}


def circle(radius: float) -> Trajectory:
    angles = np.linspace(0.0, 6.0, 50)
    at = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles])
    return Trajectory(0.1 * np.arange(50), np.array([pose(np.eye(3), p) for p in at]))


@pytest.fixture
def run(tmp_path: Path) -> Path:
    """A folder as a run leaves it, less its picture."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "config.json").write_text(json.dumps({"scene": NASTY, "detector": "gnn", "seed": 3}))
    (folder / "metrics.json").write_text(json.dumps(METRICS))
    square = np.array([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]])
    nodes = (
        PlaneNode("p0", np.array([0.0, 1.0, 0.0]), 0.0, square[:2], (0.0, 2.5)),
        RoomNode("r0", (), square, np.array([2.0, 1.5]), 0.9),
        RoomNode("r1", (), None, np.array([9.0, 9.0]), 0.4),
    )
    write_graph(SceneGraph(nodes, (), {"r0": NASTY, "r1": "false"}), folder / "graph.json")
    table = "room,state,detection,cause\nhall,missed,,edges\nA & B,found,r0,\n,false,r1,planes\n"
    (folder / "rooms.csv").write_text(table)
    for name, radius in (("trajectory", 2.0), ("odometry", 2.2), ("truth", 2.0)):
        write_tum(circle(radius), folder / f"{name}.tum")
    return folder


class Reader(HTMLParser):
    """Fails where tags do not match; keeps what is asked for over the network."""

    VOID = frozenset({"meta", "img", "br"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.headings: list[str] = []
        self.sources: list[str] = []
        self.unnamed = 0

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        self.sources += [str(values[key]) for key in ("src", "href") if key in values]
        self.unnamed += tag == "img" and not values.get("alt")
        self.unnamed += tag == "svg" and not values.get("aria-label")
        if tag in ("h1", "h2"):
            self.headings.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        return

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def read(page: str) -> Reader:
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_the_page_is_whole(run: Path) -> None:
    page = write_report(run).read_text()
    reader = read(page)
    assert reader.headings == ["h1"] + ["h2"] * 5
    assert reader.unnamed == 0
    assert all(source.startswith("data:") for source in reader.sources)
    assert "prefers-color-scheme:dark" in page
    assert "width=device-width" in page
    assert not re.search(r"url\(|@import|<link", page)


def test_text_is_escaped(run: Path) -> None:
    page = run_page(read_run(run))
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_what_it_says(run: Path) -> None:
    page = run_page(read_run(run))
    assert "12.3 cm" in page
    assert "Rooms entered: 2; missed: 1; false detections: 1" in page
    assert "Missed: hall. Its walls are mapped; the detector did not join them" in page
    assert "False: r1. The map does not hold its walls" in page
    assert "20.0 / 31.0 ms" in page
    assert 'class="bad">This run' not in page
    metrics = METRICS | {"status": "failed", "error": "collision"}
    (run / "metrics.json").write_text(json.dumps(metrics))
    assert "This run did not end well: failed: collision" in run_page(read_run(run))


def test_a_run_without_truth(run: Path) -> None:
    (run / "truth.tum").unlink()
    (run / "rooms.csv").unlink()
    page = run_page(read_run(run))
    assert "Error along the path" not in page
    assert "missed" not in page
    assert '<th scope="row">-</th><td>-</td><td>r0</td>' in page
    read(page)


def test_a_run_that_ended_at_once(run: Path) -> None:
    nothing = Trajectory(np.zeros(0), np.zeros((0, 4, 4)))
    for name in ("trajectory", "odometry", "truth"):
        write_tum(nothing, run / f"{name}.tum")
    write_graph(SceneGraph(()), run / "graph.json")
    read(run_page(read_run(run)))


def test_bad_input(run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such run"):
        read_run(tmp_path / "nowhere")
    (run / "metrics.json").write_text("{")
    with pytest.raises(InputError, match=r"metrics\.json: expected JSON: .* at line 1"):
        read_run(run)
    (run / "metrics.json").write_text("{}")
    for rooms, said in (("", "line 1: room,state"), ("room,state,detection,cause\na,b", "line 2")):
        (run / "rooms.csv").write_text(rooms)
        with pytest.raises(InputError, match=rf"rooms\.csv: {said}"):
            read_run(run)
    with pytest.raises(InputError, match="neither a run nor tables"):
        ablation_page(tmp_path)


def test_an_ablation(tmp_path: Path) -> None:
    (tmp_path / "ablation.csv").write_text('variant,ate_m\n"a, <b>",0.1\n')
    (tmp_path / "forest.png").write_bytes(b"\x89PNG")
    page = write_ablation(tmp_path).read_text()
    assert "a, &lt;b&gt;" in page
    assert "data:image/png;base64,iVBORw==" in page
    assert read(page).unnamed == 0


def test_numbers() -> None:
    assert number(0.0123, 100.0, 1, " cm") == "1.2 cm"
    for nothing in (None, "x", True, float("nan")):
        assert number(nothing) == "-"
    assert list(leaves({"a": {"b": 1}, "c": [1], "d": None})) == [("a.b", 1), ("d", None)]
    assert html.section("Empty") == ""


@pytest.mark.parametrize("highest", [0.0, 1e-16, 0.013, 0.9, 1.0, 7.3, 42.0, 1999.0])
def test_ticks_are_round_and_reach(highest: float) -> None:
    ticks = svg.ticks(highest)
    assert ticks[0] == 0.0
    assert ticks[-1] >= highest * 0.999
    assert 2 <= len(ticks) <= 7


def test_the_colour_of_the_path_is_its_error() -> None:
    path = np.column_stack([np.arange(10.0), np.zeros(10)])
    errors = np.where(np.arange(10) < 5, 0.0, 0.1)
    drawn = svg.plan([], [], path, errors)
    assert drawn.count("<polyline") == 2
    assert drawn.index(svg.BINS[0]) < drawn.index(svg.BINS[-1])
    assert svg.plan([], [], np.zeros((0, 2)), np.zeros(0)) == ""
