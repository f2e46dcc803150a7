"""``roomloop score``: another system's results against a scene's truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from eval.config import RunConfig
from eval.names import known, refuse

if TYPE_CHECKING:
    from eval.comparing.tables import Sheet
    from eval.metrics import Metrics
    from eval.score.foreign import Foreign
    from eval.score.trajectory import Trajectory

Option = typer.Option
File = Path | None


def score(
    scene: Annotated[
        str,
        typer.Argument(help="A run's folder, whose scans the other system was given; or a scene."),
    ],
    trajectory: Annotated[File, Option(help="Poses, TUM: stamp x y z qx qy qz qw.")] = None,
    map: Annotated[File, Option(help="Point cloud, PLY or PCD.")] = None,
    rooms: Annotated[File, Option(help="Rooms, JSON: polygons or centres.")] = None,
    dsg: Annotated[File, Option(help="Spark-DSG scene graph (Hydra), JSON.")] = None,
    truth: Annotated[File, Option(help="True base poses, TUM (default: the run's).")] = None,
    frame: Annotated[str, Option(help="Whose poses the trajectory has: base or lidar.")] = "base",
    seed: Annotated[int, Option(help="Of a scene as built.")] = RunConfig.seed,
    conditions: Annotated[
        str | None, Option(help="How a scene was built (default: as it says).")
    ] = None,
    storey: Annotated[int | None, Option(help="Of a scene, counted from 0.")] = None,
    out: Annotated[File, Option(help="Write metrics.json to this folder.")] = None,
) -> None:
    """Score another system's results.

    Its trajectory, map or rooms against a scene's truth, with the same metrics as a run's.
    A trajectory is aligned with the true one, and the map and the rooms with it; without a
    trajectory they are taken to be in the scene's own frame. What does not apply is null.
    """
    from eval.files import make_folder, write_text
    from eval.outputs import metrics_json
    from eval.score.foreign import score_foreign
    from eval.screen import line, output, show_sheet

    if trajectory is map is rooms is dsg is None:
        refuse("score: expected at least one of --trajectory, --map, --rooms and --dsg")
    if rooms is not None and dsg is not None:
        refuse("score: expected --rooms or --dsg, got both")
    known("frame", frame, ("base", "lidar"))
    if out is not None:
        _check_out(out)
    config = RunConfig(scene, seed=seed, conditions=conditions, storey=storey)
    config, true_poses = _truth(config, truth)
    metrics = score_foreign(config, true_poses, _foreign(trajectory, map, rooms, dsg, frame))
    console = output()
    show_sheet(console, score_sheet(metrics))
    if out is not None:
        make_folder(out)
        write_text(out / "metrics.json", metrics_json(metrics))
        line(console, str(out / "metrics.json"))


def _check_out(out: Path) -> None:
    from eval.folder import CONFIG_FILE

    if out.is_file() or (out / CONFIG_FILE).exists():
        refuse(f"out: {out} is a file or a run's folder, expected another folder")


def _truth(config: RunConfig, truth: Path | None) -> tuple[RunConfig, Trajectory | None]:
    """The run or scene that is meant, and its true poses."""
    from eval.folder import read_config
    from eval.outputs import read_tum

    folder = Path(config.scene)
    if folder.is_dir():
        config = read_config(folder)
        truth = truth or folder / "truth.tum"
    return config, None if truth is None else read_tum(truth)


def _foreign(trajectory: File, cloud: File, rooms: File, dsg: File, frame: str) -> Foreign:
    from eval.foreign import read_dsg, read_rooms
    from eval.outputs import read_tum
    from eval.pointfile import read_cloud
    from eval.score.foreign import Foreign, base_poses
    from sim.base import BaseConfig

    estimate = None if trajectory is None else read_tum(trajectory)
    found = None if rooms is None else read_rooms(rooms)
    if dsg is not None:
        graph = read_dsg(dsg)
        found = graph.rooms
        estimate = graph.trajectory if estimate is None else estimate
    if estimate is not None and frame == "lidar":
        estimate = base_poses(estimate, BaseConfig().T_base_lidar)
    return Foreign(estimate, None if cloud is None else read_cloud(cloud), found)


SHOWN = (
    *("ate_m", "ate_xy_m", "ate_z_m", "yaw_deg", "rpe_percent", "ate_origin_m", "mma_m"),
    *("rooms.truth", "rooms.entered", "rooms.centre_precision", "rooms.centre_recall"),
    "rooms.mean_iou",
)


def score_sheet(metrics: Metrics) -> Sheet:
    """What applies, one row a number."""
    from eval.comparing.tables import Sheet
    from eval.comparing.values import value_of

    values = {name: value_of(metrics, name) for name in SHOWN}
    rows = tuple((name, f"{value:.6g}") for name, value in values.items() if value is not None)
    return Sheet(f"{metrics.scene}, seed {metrics.seed}", ("metric", "value"), rows)
