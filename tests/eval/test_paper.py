"""The paper's tables: its numbers, which runs they need, and what is said of made-up runs."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from papers import BASE, cell, measured_of, paper_runs, stub

from eval.cli import main
from eval.commands.paper import _Asked, plan_files
from eval.comparing.ablation import BOOTSTRAP_SEED
from eval.comparing.stats import bootstrap
from eval.config import RunConfig
from eval.graphfile import PlaneNode, RoomNode, SceneGraph, WallNode, write_graph
from eval.metrics import Rooms
from eval.paper import figures, report, study
from eval.paper.figures import Panel, centre_matches, rooms_caption, rooms_png, scenes_png
from eval.paper.published import (
    ATE,
    FIGURE_CLAIMS,
    FIRST_ROOM,
    HYDRA,
    HYDRA_TUNED,
    MMA,
    OURS,
    REAL,
    ROOMS_ONLY,
    SCENES,
    SGRAPHS,
    SGRAPHS_TUNED,
    SIMULATED,
    WALL_RECALL,
)
from eval.paper.sheets import rooms_sheet, spread, summary_sheet
from eval.paper.study import INFORMATIVE, PLANES_ONLY, Measured
from eval.sweep.job import Job, Row
from eval.sweep.store import open_store
from slam.core import InputError
from worlds.catalogue import load_scene, scene_counts


@pytest.fixture(scope="module")
def paper() -> Measured:
    return paper_runs()


# --- what the paper says --------------------------------------------------------------------------


def test_the_means_that_the_paper_prints_follow_from_its_numbers() -> None:
    def mean(values, scenes) -> float:
        return float(np.mean([values[scene] for scene in scenes]))

    assert mean(FIRST_ROOM[SGRAPHS], SIMULATED) == pytest.approx(77.8)
    assert mean(FIRST_ROOM[OURS], SIMULATED) == pytest.approx(12.2)
    assert mean(FIRST_ROOM[SGRAPHS], REAL) == pytest.approx(179.9, abs=0.05)
    assert mean(FIRST_ROOM[OURS], REAL) == pytest.approx(67.1, abs=0.05)
    ate = {name: mean(values, SIMULATED) for name, values in ATE.items()}
    assert [round(100 * ate[name], 2) for name in (SGRAPHS, ROOMS_ONLY, OURS)] == [3.09, 2.93, 2.88]
    assert 1 - ate[OURS] / ate[SGRAPHS] == pytest.approx(0.068, abs=2e-3)
    assert 1 - ate[OURS] / ate[ROOMS_ONLY] == pytest.approx(0.017, abs=2e-3)
    mma = {name: float(np.mean(list(values.values()))) for name, values in MMA.items()}
    assert 1 - mma[OURS] / mma[SGRAPHS] == pytest.approx(0.018, abs=2e-3)
    assert mean(WALL_RECALL, SIMULATED) == pytest.approx(0.80, abs=5e-3)


@pytest.mark.parametrize("name", SCENES)
def test_the_scenes_hold_what_table_one_says(name: str) -> None:
    plain = SCENES[name].replace("corridors", "corridor")
    counts = scene_counts(load_scene(name)).rooms
    assert {f"{count} {shape}" for shape, count in counts} == set(plain.split(", "))


# --- which runs -----------------------------------------------------------------------------------


def test_the_catalogue_has_every_method_on_nine_scenes() -> None:
    ablation = study.catalogue((0, 1, 2, 3, 4), BASE, quick=False).ablation
    assert len(ablation.configs) == 9 * 5 * (len(study.VARIANTS) + 1)
    baseline = dict(next(v.fields for v in ablation.variants if v.name == SGRAPHS))
    assert baseline == {"detector": "sgraphs", "layers": "rooms", "factors": "paper"}
    needed = {name for claim in FIGURE_CLAIMS for name in (claim.variant, claim.against)}
    assert needed <= {variant.name for variant in ablation.variants}


def test_planes_alone_are_run_on_the_papers_scenes_only() -> None:
    paper = study.catalogue((0,), BASE, quick=True).ablation
    assert (INFORMATIVE, PLANES_ONLY) in paper.pairs
    alone = next(variant for variant in paper.variants if variant.name == PLANES_ONLY)
    assert dict(alone.fields) == {"detector": "none", "layers": "planes", "factors": "paper"}
    others = [study.fresh([Path("a.json")], BASE), *study.beyond((0,), BASE, quick=True)]
    for group in others:
        names = {variant.name for variant in group.ablation.variants}
        assert PLANES_ONLY not in names
        assert {name for pair in group.ablation.pairs for name in pair} <= names
        assert set(study.AGAINST_BASELINES) <= set(group.ablation.pairs)


def test_fresh_buildings_follow_from_the_weights_alone(tmp_path: Path) -> None:
    weights = tmp_path / "weights.npz"
    weights.write_bytes(b"trained")
    seed = study.fresh_seed([weights])
    assert seed == int(hashlib.sha256(b"trained").hexdigest(), 16)
    texts = [
        [path.read_text() for path in study.write_plans(study.fresh_plans(seed, 3), tmp_path / at)]
        for at in ("a", "b")
    ]
    assert texts[0] == texts[1]
    assert len(set(texts[0])) == 3
    weights.write_bytes(b"trained again")
    other = study.write_plans(study.fresh_plans(study.fresh_seed([weights]), 3), tmp_path / "c")
    assert not set(texts[0]) & {path.read_text() for path in other}
    for path in other:
        assert len(load_scene(str(path)).storeys[0].rooms) >= study.FRESH_ROOMS


def test_beyond_has_worlds_conditions_and_the_users_plans() -> None:
    groups = study.beyond((0,), BASE, quick=False)
    names = [group.name for group in groups]
    assert {"World hotel", "World angled", "Condition real-site", "Condition people"} <= set(names)
    people = groups[names.index("Condition people")].ablation
    assert {config.conditions for config in people.configs} == {"people"}
    (plan,) = study.of_plans(["mine/office.json"], (3,), BASE)
    assert plan.name == "Plan office"
    assert {config.scene for config in plan.ablation.configs} == {"mine/office.json"}


def test_a_folder_stands_for_its_plans(tmp_path: Path) -> None:
    for name in ("b.json", "a.json", "notes.txt"):
        (tmp_path / name).touch()
    expected = [str(tmp_path / "a.json"), str(tmp_path / "b.json"), "c.json"]
    assert plan_files(f"{tmp_path}, c.json") == expected


# --- what is said of them -------------------------------------------------------------------------


def test_a_spread_is_over_runs_and_its_interval_over_seeds(paper: Measured) -> None:
    level = paper.result(("SE1", "SE3")).level(OURS, "rooms.recall")
    found = spread(level)
    values = np.array([level.values["SE1"], level.values["SE3"]])
    assert found is not None
    assert found.mean == pytest.approx(values.mean())
    assert (found.low, found.high, found.count) == (values.min(), values.max(), 6)
    assert found.deviation == pytest.approx(values.std(ddof=1))
    samples = {"SE1": values[0], "SE3": values[1]}
    assert found.interval == bootstrap(samples, np.random.default_rng(BOOTSTRAP_SEED))


def test_intervals_of_shares_end_at_one(paper: Measured) -> None:
    values = {"SE1": (1.0,), "SE2": (1.0,), "SE3": (0.5,)}
    for metric, most in (("rooms.recall", 1.0), ("first_room_s", np.inf)):
        found = spread(replace(paper.result(SIMULATED).level(OURS, metric), values=values))
        assert found is not None
        assert found.interval is not None
        assert found.mean < found.interval.high <= most
        assert (found.interval.high > 1.0) == (most > 1.0)


def test_the_baselines_have_no_walls(paper: Measured) -> None:
    summary = summary_sheet("", paper.result())
    assert cell(summary, SGRAPHS, "walls R") == "-"
    assert cell(summary, OURS, "walls R").startswith("0.80")


def test_runs_without_a_value_are_left_out_and_counted(paper: Measured) -> None:
    level = paper.result(REAL).level(HYDRA, "rooms.centre_precision")
    found = spread(level)
    assert found is not None
    assert found.count == 3 * (len(REAL) - 1)
    assert spread(level, ["RC2F2"]) is None
    rooms = rooms_sheet(paper.result(REAL), "real")
    assert cell(rooms, HYDRA, "runs", measure="precision, centre rule") == "9 of 12"


def test_one_drive_a_building_has_its_interval_over_buildings(tmp_path: Path) -> None:
    files = [tmp_path / f"b{place}.json" for place in range(4)]
    result = measured_of(study.fresh(files, BASE)).result()
    level = result.level(OURS, "rooms.recall")
    values = {scene: (place / 4.0,) for place, scene in enumerate(level.values)}
    found = spread(replace(level, values=values))
    assert found is not None
    assert found.interval is not None
    assert found.interval.low < found.mean < found.interval.high


def test_ours_stands_beside_the_papers(paper: Measured) -> None:
    sheets = {sheet.title: sheet for sheet in report.catalogue_sheets(paper)}
    ate = sheets["ATE, simulated scenes [cm] (Table IV)"]
    assert cell(ate, "mean", f"{SGRAPHS} (paper)") == "3.09"
    assert cell(ate, "SE3", OURS).startswith("2.00")
    assert cell(ate, "SE3", f"{OURS} (paper)") == "2.23"
    real = sheets["ATE, real-condition scenes [cm] (not published)"]
    assert not [name for name in real.head if "(paper)" in name]
    mma = sheets["MMA [cm] (Table V)"]
    assert cell(mma, "mean", f"{OURS} (paper)") == "21.95"
    assert "SE1" not in {row[0] for row in mma.rows}
    first = sheets["First room, simulated scenes [s] (Table III)"]
    assert cell(first, "mean", f"{SGRAPHS} (paper)") == "77.8"
    assert first.head[3:5] == (SGRAPHS_TUNED, OURS)
    assert cell(first, "SE1", OURS).startswith("2.0 [")
    short = sheets[report.IN_SHORT]
    assert [row[0] for row in short.rows] == ["simulated scenes", "real-condition scenes"]
    walls = sheets["Walls, real-condition scenes (Table II)"]
    assert cell(walls, "RC1F2", "recall (paper)") == "0.75"


def test_a_method_without_planes_has_the_centre_rule_only(paper: Measured) -> None:
    sheet = rooms_sheet(paper.result(), "all")
    measures = [row[1] for row in sheet.rows if row[0] == HYDRA]
    assert measures == ["precision, centre rule", "recall, centre rule"]
    summary = summary_sheet("", paper.result())
    assert cell(summary, HYDRA, "rooms P") == "-"


def test_the_catalogue_counts_with_the_seeds_that_were_run(paper: Measured, tmp_path: Path) -> None:
    with open_store(tmp_path) as store:
        for config, row in paper.rows.items():
            if config.seed < 2 or config.scene == "SE1":
                store.add(Job(config), row)
    found = study.already_measured(paper.group, tmp_path)
    assert found is not None
    assert found.group.ablation.seeds == (0, 1)
    level = (OURS, "rooms.recall")
    values = paper.result().level(*level).values
    assert found.result().level(*level).values == {s: v[:2] for s, v in values.items()}
    assert study.already_measured(paper.group, tmp_path / "none") is None


def test_groups_stand_beside_one_another() -> None:
    groups = study.beyond((0, 1), BASE, quick=True)
    rooms, causes, *summaries = report.beyond_sheets([measured_of(group) for group in groups])
    names = [group.name for group in groups]
    assert [row[0] for row in rooms.rows] == names
    assert [sheet.title for sheet in summaries] == names
    angled = summary_sheet("", measured_of(groups[0]).result())
    means = [cell(angled, OURS, f"rooms {what} (centre)")[:4] for what in "PR"]
    assert cell(rooms, "World angled", OURS) == " / ".join(means)
    assert causes.rows[0][:3] == (OURS, "World angled", "16")
    assert [row[1] for row in causes.rows] == names * len(study.DETECTORS)


# --- pictures and files ---------------------------------------------------------------------------


def graph_of(house) -> SceneGraph:
    """A and C found, and one room where there is none; the wall between A and B."""
    nodes = [
        RoomNode(f"r{place}", (), np.array(outline, dtype=float), np.mean(outline, axis=0), 1.0)
        for place, outline in enumerate(
            (
                [(0, 0), (4, 0), (4, 3), (0, 3)],
                [(0, 3.1), (8.1, 3.1), (8.1, 4.6), (0, 4.6)],
                [(20, 0), (24, 0), (24, 3)],
            )
        )
    ]
    planes = [
        PlaneNode(
            f"p{face}",
            house.truth.faces[face].normal,
            0.0,
            house.truth.faces[face].segment,
            (0.0, 2.5),
        )
        for face in (1, 7)
    ]
    return SceneGraph((*nodes, *planes, WallNode("w0", ("p1", "p7"))), (), {"w0": "wall 0"})


def panel_of(house, method: str) -> Panel:
    detector = "hydra" if method == HYDRA else "gnn"
    rooms = Rooms(3, 3, 3.0, 2.0, 2 / 3, 2 / 3, 2 / 3, 2 / 3)
    metrics = replace(stub(RunConfig("SE3", detector=detector)), rooms=rooms)
    return Panel("SE3", method, graph_of(house), metrics, house.truth)


def test_a_panel_is_judged_by_centres(house) -> None:
    panel = panel_of(house, OURS)
    assert centre_matches(panel) == {"r0": 0, "r1": 2}
    said = "P 2/3, R 2/3; by pieces P 2/3, R 2/3\npaper: P 10/10, R 10/14"
    assert rooms_caption(panel) == said
    assert rooms_caption(panel_of(house, HYDRA)) == "P 2/3, R 2/3\npaper: P 9/13, R 9/14"


def test_pictures_are_made(house, paper: Measured) -> None:
    methods = [variant.name for variant in study.DETECTORS]
    worlds = [(world, paper.result(scenes)) for world, scenes in report.worlds(paper)]
    panels = [panel_of(house, method) for method in methods]
    lines = [[panel.method for _, panel in line] for line in figures._lines(panels, "SE3")]
    assert lines == [methods[:4], [*methods[4:], OURS]]
    for data in (rooms_png(worlds, methods), scenes_png(panels)):
        assert data.startswith(b"\x89PNG")
        assert 10_000 < len(data) < 700_000
    assert int.from_bytes(data[16:20]) <= 1600  # its width


def test_the_command_writes_its_reports(monkeypatch, house, tmp_path: Path, capsys) -> None:
    graph = tmp_path / "graph.json"
    write_graph(graph_of(house), graph)

    def sweep(configs, settings, watch):
        assert settings.runner == "eval.paper.keep:run_and_keep"
        with open_store(settings.folder) as store:
            store.plan([])
        return [Row(c, "complete", None, 1.0, stub(c)) for c in configs]

    monkeypatch.setattr(study, "sweep", sweep)
    monkeypatch.setattr("eval.paper.keep.kept_graph", lambda config: graph)
    out = tmp_path / "out"
    out.mkdir()
    plan = study.write_plans(study.fresh_plans(1, 1), tmp_path)[0]
    for flags in ([], ["--fresh"], ["--beyond"], ["--beyond", "--plans", str(plan)]):
        assert main(["paper", "--quick", "--out", str(out), *flags]) == 0
    names = {path.name for path in out.iterdir() if path.is_file()}
    assert {
        f"{kind}.{end}" for kind in ("paper", "fresh", "beyond", "plans") for end in ("md", "tex")
    } <= names
    assert {"paper-rooms.png", "paper-scenes.png", "fresh-rooms.png", "paper.csv"} <= names
    text = (out / "paper.md").read_text()
    assert "The recordings of its real scenes are not public" in text
    assert "| SE3 | Hydra RS |" in text
    assert "| Plan fresh-00 |" in (out / "plans.md").read_text()
    assert f"| SE3 | {HYDRA_TUNED} |" in text
    assert f"Aims for {OURS}, buildings it never saw" in (out / "plans.md").read_text()
    assert f"Aims for {OURS}" not in (out / "beyond.md").read_text()
    kinds = {line.partition(",")[0] for line in (out / "paper.csv").read_text().splitlines()}
    assert kinds == {"scenes", "all", "simulated", "real-condition"}
    assert "paper.md" in capsys.readouterr().out


def test_fresh_buildings_are_put_into_a_new_folder_and_used_again(tmp_path: Path) -> None:
    out = tmp_path / "new" / "out"
    asked = _Asked(out, True, (0,))
    scenes = [asked.groups("fresh")[0].ablation.scenes for _ in range(2)]
    assert scenes[0] == scenes[1]
    assert all(Path(scene).parent == out / "fresh-plans" for scene in scenes[0])
    with open_store(out) as store:  # a sweep takes the folder for its own
        assert store.folder == out
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").touch()
    with pytest.raises(InputError, match=r"holds files but no sweep\.json"):
        _Asked(tmp_path / "notes", True, (0,)).groups("fresh")


@pytest.mark.parametrize(
    ("flags", "said"),
    [
        (["--fresh", "--beyond"], "fresh: expected --fresh or --beyond"),
        (["--plans", "a.json"], "plans: expected together with --beyond"),
        (["--beyond", "--plans", "none.json"], "none.json"),
        (["--beyond", "--plans", "."], "plans: .: expected plan files"),
        (["--seeds", "x"], "seeds"),
    ],
)
def test_what_makes_no_sense_is_refused(flags, said, tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["paper", "--out", str(tmp_path / "out"), *flags]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
