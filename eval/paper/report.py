"""The reports: which sheets say what was measured, and what is to be known beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from eval.comparing.ablation import Result
from eval.comparing.bounds import Bound
from eval.comparing.tables import Sheet, markdown
from eval.paper.differences import against_sheet, baselines_sheet, claims_sheet
from eval.paper.failures import causes_sheet, failures_sheet
from eval.paper.figures import Panel, rooms_caption, walls_caption
from eval.paper.published import (
    ATE,
    CLAIMS,
    COUNTS,
    FIGURE_CLAIMS,
    FIRST_ROOM,
    MMA,
    MMA_SCENES,
    OURS,
    REAL,
    ROOMS_ONLY,
    SGRAPHS,
    SGRAPHS_TUNED,
    SIMULATED,
    WALL_COUNTS,
    WALL_PRECISION,
    WALL_RECALL,
    Values,
)
from eval.paper.sheets import (
    Column,
    bars_sheet,
    beside_sheet,
    groups_sheet,
    per_scene_sheet,
    rooms_sheet,
    scenes_sheet,
    summary_sheet,
)
from eval.paper.study import (
    AGAINST_BASELINES,
    BY_PIECES,
    CENTRE_RULE,
    INFORMATIVE,
    OUR_CLAIMS,
    PLANES_ONLY,
    Measured,
)

AIMS = (
    Bound("rooms.precision", ">=", 1.0),
    Bound("rooms.recall", ">=", 0.95),
    Bound("rooms.mean_iou", ">=", 0.85),
    Bound("rooms.piece_f1", ">=", 0.90),
    Bound("walls.precision", ">=", 1.0),
    Bound("walls.recall", ">=", 0.95),
    Bound("first_room_s", "<=", 0.5),
    Bound("room_latency_s.median", "<=", 1.5),
    Bound("room_latency_s.p95", "<=", 8.0),
    Bound("rooms.id_switches", "<=", 0.0),
    Bound("ate_m", "<=", 0.015),
    Bound("mma_m / mma_floor_m", "<=", 1.2),
    Bound("plane_rmse_m", "<=", 0.01),
)
"""Of ours on the simulated scenes."""
REAL_AIMS = (Bound("rooms.precision", ">=", 0.95), Bound("rooms.recall", ">=", 0.85))
PLAN_AIMS = (Bound("rooms.precision", ">=", 0.95), Bound("rooms.recall", ">=", 0.90))
"""Over all plans of the user."""
FRESH_LIMIT = 0.03
"""How far precision and recall in fresh buildings may be from the catalogue's."""

IN_SHORT = "Rooms in short: precision / recall by the centre rule"

NOTES = (
    "A mean is over seeds, then over scenes; [..] is its 95 % bootstrap interval over the seeds "
    "(over the buildings where each is driven once); * marks an interval clear of zero. Deviation, "
    "minimum and maximum are over all runs. A precision without any detection, and the time of a "
    "first room that was never found, are left out of their means. The paper's means are over the "
    "same scenes, as far as it has them. '-': nothing to judge, or a drive so short and straight "
    "that it cannot be aligned with the truth.",
    "Centre rule: a detection is true if its centre lies in the room, one to one. It also fits "
    "Hydra, which knows no planes, and is used wherever Hydra is compared. By pieces: most planes "
    "must belong to the room, too; a room of two planes earns half, as in the paper.",
    "Hydra RS and S-Graphs+ are our implementations of what is published, with the published "
    "parameters; 'tuned': with those that find most on generated training buildings "
    "(`roomloop bench baselines`). The paper's numbers stand beside the published ones.",
    "The worlds are reconstructions from what the paper tells of them. The recordings of its real "
    "scenes are not public: ours are simulated under building-site conditions. So a number here "
    "and the paper's beside it are not of the same scans, and only the rows of one table are.",
    "Table III of the paper is headed ms and captioned s; seconds are taken, here too: until the "
    "first room of at least four true faces (all, if it has fewer) is found.",
    "Ours less each baseline: P and R as they are, seed by seed, of runs in which both have a "
    "value. Planes only: the graph without a detector.",
    "6.8 % (ATE) and 1.8 % (MMA) are against S-Graphs+; that walls add 1.7 % to rooms alone "
    "follows from the means of Table IV.",
    "The paper scores SE3 over 14 of its rooms; here all 26 are driven, so its counts have other "
    "denominators.",
    "Ours is the network that ships with roomloop, trained on its own generated buildings. The "
    "paper's own method, trained anew, is the detector `paper` (`roomloop ablate --detector "
    "gnn,paper`).",
    "Failures: the first stage that had it wrong, by the truth. unseen: fewer than three faces of "
    "the room were seen; planes: the map lacks them, or holds them on planes of mixed points; "
    "edges: the network's edges do not join them, or join strangers; clustering: they do, and what "
    "follows lost the room. A false detection is planes before all else if half of its pieces or "
    "more lie on no room's face (furniture, pillars, mixed points); and edges if they left its "
    "part of a room apart from the rest. Detectors without edges have the last two under "
    "clustering, and planes, too, if they use none (Hydra) or found no room at all in a run. half: "
    "rooms found by two faces alone, which count half in P and R by pieces.",
)


def catalogue_sheets(measured: Measured) -> list[Sheet]:
    """Every table of the paper that there are runs for."""
    simulated, real = measured.of(SIMULATED), measured.of(REAL)
    kinds = [(f"{world} scenes", measured.result(scenes)) for world, scenes in worlds(measured)]
    sheets = [scenes_sheet((*simulated, *real)), groups_sheet(IN_SHORT, kinds)]
    for world, scenes in worlds(measured):
        sheets.append(rooms_sheet(measured.result(scenes), world))
    sheets.append(
        claims_sheet("Rooms, relative (a change up is for the better)", measured, FIGURE_CLAIMS)
    )
    of_rooms = (*CENTRE_RULE, *BY_PIECES)
    compared = [
        (world, measured.compared(scenes, AGAINST_BASELINES, of_rooms))
        for world, scenes in worlds(measured)
    ]
    sheets.append(baselines_sheet("Rooms, ours less each baseline", compared))
    for world, scenes in worlds(measured):
        result = measured.result(scenes)
        sheets += _walls_and_first_room(result, world)
    for world, scenes in worlds(measured):
        of = "Table IV" if scenes[0] in SIMULATED else "not published"
        title = f"ATE, {world} scenes [cm] ({of})"
        sheets.append(beside_sheet(title, measured.result(scenes), _graph_columns("ate_m", ATE)))
    of_mma = measured.result(measured.of(MMA_SCENES))
    sheets.append(beside_sheet("MMA [cm] (Table V)", of_mma, _graph_columns("mma_m", MMA)))
    floor = [Column(OURS, "mma_m", {}, "MMA"), Column(OURS, "mma_floor_m", {}, "sensor alone")]
    title = "MMA and what the sensor alone leaves [cm]"
    sheets.append(beside_sheet(title, measured.result(), floor))
    title = "Relative differences of the text (a change down is for the better)"
    sheets.append(claims_sheet(title, measured, (*CLAIMS, *OUR_CLAIMS)))
    sheets.append(summary_sheet("In short, all scenes", measured.result()))
    sheets.append(failures_sheet("Missed and false rooms by cause, all runs", measured.result()))
    for (world, scenes), aims in zip(_both(measured), (AIMS, REAL_AIMS), strict=True):
        if scenes:
            title = f"Aims for {OURS}, {world} scenes"
            sheets.append(bars_sheet(title, [measured.result(scenes)], OURS, aims))
    return sheets


def _both(measured: Measured) -> list[tuple[str, tuple[str, ...]]]:
    return [("simulated", measured.of(SIMULATED)), ("real-condition", measured.of(REAL))]


def worlds(measured: Measured) -> list[tuple[str, tuple[str, ...]]]:
    """Kinds of world with their scenes, of which some were run."""
    return [(world, scenes) for world, scenes in _both(measured) if scenes]


def _walls_and_first_room(result: Result, world: str) -> list[Sheet]:
    walls = [
        Column(OURS, "walls.precision", WALL_PRECISION, "precision"),
        Column(OURS, "walls.recall", WALL_RECALL, "recall"),
    ]
    methods = (SGRAPHS, SGRAPHS_TUNED, OURS)
    first = [Column(name, "first_room_s", FIRST_ROOM.get(name, {})) for name in methods]
    return [
        beside_sheet(f"Walls, {world} scenes (Table II)", result, walls),
        beside_sheet(f"First room, {world} scenes [s] (Table III)", result, first, digits=1),
    ]


def _graph_columns(metric: str, published: Mapping[str, Values]) -> list[Column]:
    names = (SGRAPHS, SGRAPHS_TUNED, ROOMS_ONLY, OURS, INFORMATIVE, PLANES_ONLY)
    return [Column(name, metric, published.get(name, {})) for name in names]


def counts_sheet(panels: Sequence[Panel]) -> Sheet:
    """What stands under the qualitative figure."""
    rows = []
    for panel in panels:
        theirs = COUNTS.get((panel.scene, panel.method))
        ours = rooms_caption(panel).partition("\n")[0]
        says = "P {}, R {}".format(*theirs) if theirs else "not published"
        rows.append((panel.scene, panel.method, ours, says))
        if panel.method == OURS:
            walls = walls_caption(panel).partition("\n")[0]
            rows.append((panel.scene, f"{OURS}, walls", walls, WALL_COUNTS[panel.scene]))
    head = ("scene", "method", "what", "the paper says")
    return Sheet(f"The qualitative figure, seed {panels[0].metrics.seed}", head, tuple(rows))


def fresh_sheets(measured: Measured, paper: Measured | None) -> list[Sheet]:
    """Buildings that nobody can have tuned on, beside the catalogue if it was run."""
    result = measured.result()
    names = {scene: Path(scene).stem for scene in result.ablation.scenes}
    sheets = [
        summary_sheet(f"{len(names)} fresh buildings", result),
        per_scene_sheet("Each building: rooms, precision / recall", result, names),
        failures_sheet("Missed and false rooms by cause", result),
    ]
    if paper is not None:
        scenes = paper.of(SIMULATED)
        title = "Fresh buildings against the simulated scenes of the catalogue"
        columns = ("catalogue", "fresh")
        sheets.append(against_sheet(title, paper.result(scenes), result, columns, FRESH_LIMIT))
    return sheets


def beyond_sheets(measured: Sequence[Measured]) -> list[Sheet]:
    """All groups beside one another, and then one after the other."""
    groups = [(part.group.name, part.result()) for part in measured]
    causes = causes_sheet("Missed and false rooms by cause", groups)
    summaries = [summary_sheet(name, result) for name, result in groups]
    return [groups_sheet(IN_SHORT, groups), causes, *summaries]


def plans_sheets(measured: Sequence[Measured]) -> list[Sheet]:
    """The same of the user's plans, and what is aimed at over all of them."""
    results = [part.result() for part in measured]
    title = f"Aims for {OURS}, buildings it never saw"
    return [*beyond_sheets(measured), bars_sheet(title, results, OURS, PLAN_AIMS)]


def report_text(
    title: str, sheets: Sequence[Sheet], pictures: Sequence[str], remarks: Sequence[str]
) -> str:
    """A report as Markdown. remarks: about this measurement, before the notes on all."""
    head = "".join(f"{remark}\n\n" for remark in remarks)
    shown = "".join(f"![{name}]({name})\n\n" for name in pictures)
    notes = "".join(f"- {note}\n" for note in NOTES)
    return f"# {title}\n\n{head}{shown}{markdown(sheets, note='')}\n## Notes\n\n{notes}"
