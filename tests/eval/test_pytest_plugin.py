"""Scenario files as tests, in somebody else's repository that has its own ``eval`` and ``sim``."""

from __future__ import annotations

import os
import sys
import xml.etree.ElementTree as ET
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest_plugins = ["pytester"]

ROOT = Path(__file__).parents[2]
HERE = Path(__file__).parent

COMMAND = """
import sys
sys.path[:0] = [{root!r}, {here!r}]
from types import SimpleNamespace
import fakes
from eval.folder import claim_folder
from eval.outputs import write_metrics
from slam.core import RunError

def run(config, progress, watchers=()):
    metrics = fakes.run_stub(config)
    folder = claim_folder(config)
    write_metrics(metrics, folder / "metrics.json")
    if config.start == "fails":
        raise RunError("the base hit a wall")
    return SimpleNamespace(metrics=metrics, folder=folder)

sys.modules["eval.run"] = SimpleNamespace(run=run)
from eval.cli import main
sys.exit(main())
"""

GOOD = 'scene = "SE1"\nseeds = [1]\n[expect]\nate_m = "< 1"\n"rooms.precision" = ">= 0.9"\n'
BAD = 'scene = "SE1"\nseeds = [1, 2]\nmarkers = ["long"]\n[expect]\nate_m = "< 0.001"\n'


@pytest.fixture
def repository(pytester: pytest.Pytester) -> pytest.Pytester:
    """A user's repository: its own packages and tests, and a folder of scenarios."""
    command = pytester.path / "roomloop_command.py"
    command.write_text(COMMAND.format(root=str(ROOT), here=str(HERE)))
    pytester.makeini(
        f"[pytest]\nroomloop_command = {sys.executable} {command}\n"
        "addopts = --strict-markers\nmarkers = long: takes long\n"
    )
    for package in ("eval", "sim"):
        folder = pytester.mkpydir(package)
        (folder / "mine.py").write_text("ANSWER = 42\n")
    pytester.makepyfile(
        test_mine="from eval.mine import ANSWER\nimport sim.mine\n\ndef test_it():\n"
        "    assert ANSWER == sim.mine.ANSWER == 42\n"
    )
    pytester.path.joinpath("pyproject.toml").write_text('[project]\nname = "mine"\n')
    folder = pytester.mkdir("scenarios")
    (folder / "good.toml").write_text(GOOD)
    (folder / "bad.scenario.toml").write_text(BAD)
    (folder / "notes.toml").write_text('title = "no scenario"\n')
    return pytester


def run(repository: pytest.Pytester, *arguments: str) -> pytest.RunResult:
    """pytest with the plugin, as a user who has installed roomloop calls it."""
    plugin = [] if _installed() else ["-p", "roomloop_pytest"]
    return repository.runpytest_subprocess(*plugin, *arguments)


def _installed() -> bool:
    from importlib.metadata import entry_points

    return any(point.name == "roomloop" for point in entry_points(group="pytest11"))


@pytest.fixture(autouse=True)
def paths(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The user's packages come first on PYTHONPATH; the plugin stands where an install puts it."""
    place = tmp_path / "site"
    place.mkdir()
    (place / "roomloop_pytest.py").symlink_to(ROOT / "eval" / "pytest_plugin" / "__init__.py")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([".", str(place)]))


def test_scenarios_are_tests_beside_the_users_own(repository: pytest.Pytester) -> None:
    """With xdist, a report for CI, and what was written kept."""
    options = ["-v", "-n", "2", "--junitxml=report.xml", "--roomloop-out=kept"]
    result = run(repository, *options)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines(["*ate_m of seed 2 is 0.0*, expected < 0.001: missed by 0.0*"])
    result.stdout.no_fnmatch_line("*Traceback*")
    result.stdout.no_fnmatch_line("*subprocess*")

    cases = {case.get("name"): case for case in ET.parse("report.xml").iter("testcase")}
    assert set(cases) == {"good", "bad", "test_it"}
    values = {p.get("name"): float(str(p.get("value"))) for p in cases["good"].iter("property")}
    assert values["rooms.precision[seed 1]"] == 1.0
    failure = cases["bad"].find("failure")
    assert failure is not None
    assert "missed by" in str(failure.text)

    kept = repository.path / "kept" / "scenarios"
    assert (kept / "good" / "metrics.json").is_file()
    assert (kept / "bad" / "s2" / "metrics.json").is_file()


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["scenarios"], {"good", "bad"}),
        (["scenarios", "-k", "good"], {"good"}),
        (["scenarios", "-m", "not long"], {"good"}),
        (["-m", "roomloop"], {"good", "bad"}),
        (["scenarios/bad.scenario.toml::bad"], {"bad"}),
        (["scenarios/notes.toml"], {"notes"}),
    ],
)
def test_they_are_chosen_as_tests_are(
    repository: pytest.Pytester, arguments: list[str], names: set[str]
) -> None:
    result = run(repository, "--collect-only", "-q", *arguments)
    chosen = [line for line in result.outlines if line.startswith("scenarios/")]
    assert {line.rpartition("::")[2] for line in chosen} == names


WRONG = {
    "key": ('scene = "SE1"\ndetektor = "gnn"\n[expect]\n', "unknown key 'detektor'"),
    "run": ('scene = "SE1"\nstart = "fails"\n[expect]\n', "seed 0 failed: the base hit a wall"),
    "toml": ("scene = SE1", "expected TOML"),
}


def test_what_is_wrong_is_said_in_its_words(repository: pytest.Pytester) -> None:
    for name, (text, _) in WRONG.items():
        (repository.path / "scenarios" / f"odd-{name}.scenario.toml").write_text(text)
    result = run(repository, "scenarios", "-k", "odd")
    result.assert_outcomes(failed=3, deselected=None)
    for _, said in WRONG.values():
        assert said in result.stdout.str()


def test_without_roomloop_the_command_is_named(repository: pytest.Pytester) -> None:
    result = run(repository, "scenarios", "-o", "roomloop_command=absent-command", "-k", "good")
    result.assert_outcomes(failed=1, deselected=None)
    result.stdout.fnmatch_lines(["*absent-command*"])
    result.stdout.no_fnmatch_line("*Traceback*")


def test_the_command_beside_this_python_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = spec_from_file_location("plugin", ROOT / "eval" / "pytest_plugin" / "__init__.py")
    assert spec is not None
    plugin = module_from_spec(spec)
    spec.loader.exec_module(plugin)  # type: ignore[union-attr]
    unset = SimpleNamespace(getini=lambda _: "")
    places = {str(Path(sys.executable).parent): "/venv/roomloop", None: "/usr/roomloop"}
    monkeypatch.setattr(plugin.shutil, "which", lambda name, path=None: places[path])
    assert plugin._command(unset) == ["/venv/roomloop"]
    places[str(Path(sys.executable).parent)] = None  # type: ignore[assignment]
    assert plugin._command(unset) == ["/usr/roomloop"]
    places[None] = None  # type: ignore[assignment]
    with pytest.raises(pytest.UsageError, match="not on the PATH"):
        plugin._command(unset)
    assert "PYTHONPATH" not in plugin._environment()
    assert plugin._command(SimpleNamespace(getini=lambda _: "a 'b c'")) == ["a", "b c"]
