"""Who may import whom, what stays light, and what no file may say."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from eval.artefact import CODE
from eval.sweep.job import AROUND_THE_RUN

ROOT = Path(__file__).parents[1]
PACKAGES = ("worlds", "sim", "slam", "semantics", "eval")
LEAVES = ("slam.core", "slam.geometry", "slam.arrayfile", "slam.plainfile")

MAY_IMPORT = {
    "worlds": ("worlds",),
    "sim": ("sim", "worlds"),
    "slam": ("slam",),
    "semantics": ("semantics",),
    "eval": PACKAGES,
}
# The training set is made of generated plans; what runs on a robot knows nothing of them.
TRAINING = ("semantics/dataset.py", "semantics/sight.py", "semantics/train.py")

SOURCES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
HEAVY = {"torch", "open3d", "rerun", "matplotlib", "mujoco", "gtsam", "scipy", "numpy", "rich"}


def imported(path: Path) -> Iterator[str]:
    """Every module that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            # `from slam import core` imports slam.core
            yield from (
                f"{node.module}.{alias.name}" if node.module in PACKAGES else str(node.module)
                for alias in node.names
            )


def allowed(path: Path, module: str) -> bool:
    package, name = path.relative_to(ROOT).parts[0], path.relative_to(ROOT).as_posix()
    top = module.partition(".")[0]
    if top not in PACKAGES or module in LEAVES:
        return True
    return top in MAY_IMPORT[package] or (name in TRAINING and top == "worlds")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_imports_go_one_way(path: Path) -> None:
    wrong = [module for module in imported(path) if not allowed(path, module)]
    assert not wrong
    assert not {"eval", "slam", "sim", "worlds", "semantics"} & set(imported(path))


@pytest.mark.parametrize("leaf", LEAVES)
def test_leaves_import_numpy_and_each_other_only(leaf: str) -> None:
    modules = set(imported(ROOT / f"{leaf.replace('.', '/')}.py"))
    outside = {m.partition(".")[0] for m in modules - set(LEAVES)} - set(sys.stdlib_module_names)
    assert outside <= {"numpy"}


def reached_from(start: str) -> set[str]:
    """The project's modules that one imports, and those that they import."""
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        module = waiting.pop()
        path = ROOT / module.replace(".", "/")
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if module not in reached and path.exists():
            reached.add(module)
            waiting += imported(path)
    return reached


def test_a_front_end_is_named_by_every_module_that_makes_it() -> None:
    def named(module: str) -> bool:
        return any(module == part or module.startswith(f"{part}.") for part in CODE)

    assert "slam.tracking" in reached_from("slam.frontend")
    assert not {module for module in reached_from("slam.frontend") if not named(module)}


def test_a_result_is_named_by_every_module_that_computes_it() -> None:
    reached = reached_from("eval.run")
    of_eval = {module[len("eval.") :].replace(".", "/") for module in reached if "eval." in module}
    drawn, beside = {"picture", "sinks"}, ("commands/", "recordings/", "report/", "view/")
    assert drawn < of_eval
    assert "score/rooms" in of_eval
    inside = {name for name in of_eval if "/" in name and not name.startswith(beside)}
    assert {name.partition("/")[0] for name in inside} == {"score"}
    assert not (of_eval - drawn) & set(AROUND_THE_RUN)
    assert all((ROOT / "eval" / f"{name}.py").exists() for name in AROUND_THE_RUN)


def test_the_rules_can_fail(tmp_path: Path) -> None:
    for line in ("import sim.lidar", "from sim.lidar import Lidar", "from sim import lidar"):
        bad = tmp_path / "bad.py"
        bad.write_text(f"def f():\n    {line}\n")
        assert list(imported(bad)) == ["sim.lidar"]
    assert not allowed(ROOT / "slam" / "graph.py", "sim.lidar")
    assert not allowed(ROOT / "semantics" / "detector.py", "worlds.plan")
    assert not allowed(ROOT / "worlds" / "plan.py", "slam.graph")
    assert allowed(ROOT / "semantics" / "dataset.py", "worlds.generator")
    assert allowed(ROOT / "worlds" / "plan.py", "slam.core")


def loaded_by(code: str) -> set[str]:
    """The modules that a new interpreter has loaded after some code."""
    script = f"import sys\n{code}\nprint('\\n'.join(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return set(done.stdout.split())


def tops(modules: set[str]) -> set[str]:
    return {module.partition(".")[0] for module in modules}


def test_inference_loads_neither_worlds_nor_sim() -> None:
    code = """
from semantics.detector import make_detector
from slam.core import MapView
make_detector("gnn").update(MapView(0.0, (), ()))
"""
    assert not tops(loaded_by(code)) & {"worlds", "sim", "eval"}


def test_slam_loads_nothing_of_the_simulator() -> None:
    code = "import slam.frontend, slam.backend, slam.kiss, slam.vgicp"
    assert not tops(loaded_by(code)) & {"worlds", "sim", "semantics", "eval"}


def test_the_command_line_starts_light() -> None:
    assert not tops(loaded_by("import eval.cli")) & HEAVY


def test_every_package_is_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    setuptools = project["tool"]["setuptools"]
    places = setuptools["package-dir"]
    listed = [places.get(name, name).replace("/", ".") for name in setuptools["packages"]]
    folders = {path.parent.relative_to(ROOT).as_posix().replace("/", ".") for path in SOURCES}
    assert set(listed) == folders


def test_the_pytest_plugin_loads_nothing_of_ours() -> None:
    (plugin,) = (ROOT / "eval" / "pytest_plugin").glob("*.py")
    tops = {module.partition(".")[0] for module in imported(plugin)}
    assert tops - set(sys.stdlib_module_names) == {"pytest"}


@pytest.mark.parametrize(
    "pattern", ["worlds/scenes/*.json", "semantics/weights/*.npz", "eval/scenarios/*/*.toml"]
)
def test_the_data_that_ships_is_there_and_installed(pattern: str) -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    package, _, inside = pattern.partition("/")
    assert inside in project["tool"]["setuptools"]["package-data"][package]
    assert list(ROOT.glob(pattern))


def texts() -> list[Path]:
    """What a person wrote: sources, tests, scripts, documents."""
    top = [path for path in ROOT.iterdir() if path.is_file() and path.name != ".git"]
    folders = [ROOT / name for name in (*PACKAGES, "tests", ".ci")]
    below = [path for folder in folders for path in folder.rglob("*") if path.is_file()]
    endings = {"", ".py", ".md", ".toml", ".json", ".sh", ".cfg"}
    return [path for path in top + below if path.suffix in endings]


def test_no_file_names_a_place_on_somebodys_machine() -> None:
    place = re.compile(r"(?<![\w.\-/])/(?:" + "|".join(["home", "root", "Users", "work"]) + r")/\w")
    found = [path for path in texts() if place.search(path.read_text(encoding="utf-8"))]
    assert not found
