"""A pytest plugin: scenario files as tests. It is installed as the module ``roomloop_pytest``.

It imports nothing of roomloop, whose packages have names (``eval``, ``sim``) that a user's own
repository may have too: each scenario is run by the command ``roomloop run``, in a process of its
own. A file is a scenario if its name ends with ``.scenario.toml``, if it has a ``scene`` and an
``[expect]`` table, or if it is a .toml file that the command line names.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

SUFFIX = ".scenario.toml"
FAILED = (1, 3)
"""Exit status of ``roomloop run``: a bound was missed, or a run failed."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """--roomloop-out, and the ini value roomloop_command."""
    group = parser.getgroup("roomloop")
    group.addoption(
        "--roomloop-out",
        metavar="DIR",
        help="keep what scenarios write, in a folder of each one's name below DIR "
        "(default: a temporary folder, kept where a scenario fails)",
    )
    parser.addini(
        "roomloop_command",
        "the command that runs scenarios (default: the roomloop beside this Python)",
        default="",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Registers the marker that every scenario has."""
    config.addinivalue_line("markers", "roomloop: a scenario file, run by roomloop")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> ScenarioFile | None:
    """Scenario files are collected; every other .toml file is left alone."""
    if file_path.suffix != ".toml":
        return None
    named = parent.session.isinitpath(file_path)
    if not (named or file_path.name.endswith(SUFFIX) or _looks_like_one(file_path)):
        return None
    collected: ScenarioFile = ScenarioFile.from_parent(parent, path=file_path)
    return collected


def _looks_like_one(path: Path) -> bool:
    table = _table(path)
    return "scene" in table and isinstance(table.get("expect"), dict)


def _table(path: Path) -> dict[str, object]:
    """A file's content; empty where it is no TOML, which ``roomloop run`` will say."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return {}


class ScenarioFile(pytest.File):
    """A file with one scenario."""

    def collect(self) -> Iterator[ScenarioItem]:
        """The scenario, under the file's name."""
        name = self.path.name.removesuffix(".toml").removesuffix(".scenario")
        item: ScenarioItem = ScenarioItem.from_parent(self, name=name)
        item.add_marker("roomloop")
        markers = _table(self.path).get("markers", [])
        for marker in markers if isinstance(markers, list) else []:
            item.add_marker(str(marker))
        yield item


class ScenarioFailed(Exception):
    """A scenario that did not pass. The message is what the command said."""


class ScenarioItem(pytest.Item):
    """A scenario as a test: it passes if all its runs do, and every bound holds."""

    def runtest(self) -> None:
        """Runs the scenario in a process of its own."""
        out, temporary = self._folder()
        command = [*_command(self.config), "run", str(self.path), "--out", str(out)]
        try:
            done = subprocess.run(
                command,
                cwd=self.config.rootpath,
                env=_environment(),
                capture_output=True,
                text=True,
            )
        except OSError as error:
            raise ScenarioFailed(f"{command[0]}: {error.strerror or error}") from error
        self.add_report_section("call", "roomloop", done.stdout)
        for name, value in _values(out / "verdict.json"):
            self.user_properties.append((name, value))
        if done.returncode:
            raise ScenarioFailed(self._what(done.returncode, done.stderr, out))
        if temporary:
            shutil.rmtree(out, ignore_errors=True)

    def _folder(self) -> tuple[Path, bool]:
        """Where the scenario writes, and whether that is deleted again."""
        kept = self.config.getoption("--roomloop-out")
        if kept is None:
            return Path(tempfile.mkdtemp(prefix=f"roomloop-{self.name}-")), True
        root = self.config.rootpath
        inside = self.path.relative_to(root) if self.path.is_relative_to(root) else self.path.name
        return root / kept / Path(inside).with_suffix("").with_suffix(""), False

    def _what(self, status: int, errors: str, out: Path) -> str:
        # Progress goes to standard error too; what is wrong begins with the command's name.
        lines = [line for line in errors.splitlines() if line.startswith("roomloop: ")]
        said = "\n".join(line.removeprefix("roomloop: ") for line in lines)
        if status in FAILED and said:
            return f"{said}\nfiles: {out}"
        return f"roomloop ended with exit status {status}\n{said or errors}"

    def repr_failure(
        self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None
    ) -> str:
        """What the command said, without a trace of this module."""
        if isinstance(excinfo.value, ScenarioFailed):
            return str(excinfo.value)
        return str(super().repr_failure(excinfo))

    def reportinfo(self) -> tuple[Path, int, str]:
        """For the headline of a failure."""
        return self.path, 0, f"scenario {self.name}"


def _command(config: pytest.Config) -> list[str]:
    """How to call roomloop. Raises UsageError if it is not there."""
    said = str(config.getini("roomloop_command"))
    if said:
        return shlex.split(said)
    beside = shutil.which("roomloop", path=str(Path(sys.executable).parent))
    found = beside or shutil.which("roomloop")
    if found is None:
        raise pytest.UsageError("roomloop is not on the PATH: install it, or set roomloop_command")
    return [found]


def _environment() -> dict[str, str]:
    """Without the user's PYTHONPATH, whose packages could stand in the place of ours."""
    return {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}


def _values(verdict: Path) -> Iterator[tuple[str, object]]:
    """Every value that was held against a bound, for the report."""
    try:
        bounds = json.loads(verdict.read_text(encoding="utf-8"))["bounds"]
    except (OSError, ValueError, KeyError):
        return
    for bound in bounds:
        seed = "" if bound["seed"] is None else f"[seed {bound['seed']}]"
        yield f"{bound['metric']}{seed}", bound["value"]
