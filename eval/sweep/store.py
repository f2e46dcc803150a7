"""The folder of a sweep: a JSON file a run, and one table of them all.

Only the process that holds the folder's lock writes, each file whole or not at all; so nothing is
torn or counted twice, whenever anything is killed.
"""

from __future__ import annotations

import csv
import fcntl
import io
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path

from eval.comparing.values import metric_names, value_of
from eval.config import RunConfig
from eval.files import check, read_json, whole_file, write_text
from eval.folder import config_values
from eval.metrics import SCHEMA
from eval.sweep.job import NOT_OF_THE_RESULT, Job, Row, row_of, row_text
from slam.core import InputError

MARK_FILE = "sweep.json"
LOCK_FILE = ".lock"
TABLE_FILES = ("table.csv", "table.parquet")
CONFIG_COLUMNS = tuple(f.name for f in fields(RunConfig) if f.name not in NOT_OF_THE_RESULT)

Cell = str | float | None


class Store:
    """The results of a sweep in a folder. Use it through ``open_store``."""

    def __init__(self, folder: Path):
        self.folder = folder

    @property
    def scratch(self) -> Path:
        """Where runs of this machine write what is not kept; emptied by the next sweep."""
        return self.folder / ".scratch"

    def plan(self, jobs: Sequence[Job]) -> None:
        """Says which runs the folder is about; it may hold others, of earlier sweeps."""
        tree = {"schema": SCHEMA, "runs": [job.key for job in jobs]}
        write_text(self.folder / MARK_FILE, json.dumps(tree, indent=1) + "\n")

    def load(self, jobs: Sequence[Job]) -> dict[str, Row]:
        """The jobs that have been done already: key -> row. Raises InputError."""
        return read_rows(self.folder, [job.key for job in jobs])

    def add(self, job: Job, row: Row) -> None:
        """Keeps a result. Raises InputError where it cannot be written."""
        write_text(_file(self.folder, job.key), row_text(row))

    def write_table(self, rows: Sequence[Row]) -> tuple[Path, ...]:
        """Writes the table of all rows, in their order: CSV, and Parquet where pyarrow is there."""
        csv_file, parquet_file = (self.folder / name for name in TABLE_FILES)
        table = table_of(rows)
        write_text(csv_file, csv_text(table))
        return (csv_file, parquet_file) if _write_parquet(table, parquet_file) else (csv_file,)


def _file(folder: Path, key: str) -> Path:
    return folder / "runs" / f"{key}.json"


def read_rows(folder: Path, keys: Sequence[str]) -> dict[str, Row]:
    """Those of some runs that a sweep's folder holds: key -> row. Raises InputError."""
    files = {key: _file(folder, key) for key in keys}
    return {key: row_of(read_json(f), f) for key, f in files.items() if f.exists()}


def planned(folder: Path) -> list[str]:
    """The keys of the runs that a sweep's folder is about. Raises InputError."""
    mark = folder / MARK_FILE
    keys = read_json(mark).get("runs", [])
    check(isinstance(keys, list) and all(isinstance(k, str) for k in keys), mark, "runs", "keys")
    return keys  # type: ignore[return-value]


@contextmanager
def open_store(folder: Path) -> Iterator[Store]:
    """The store in a folder that is absent, empty or of an earlier sweep; ours alone meanwhile.

    Raises InputError if it is somebody else's, in use by another sweep, or cannot be written.
    """
    _check_folder(folder)
    made = not folder.exists()
    try:
        (folder / "runs").mkdir(parents=True, exist_ok=True)
        lock = os.open(folder / LOCK_FILE, os.O_CREAT | os.O_RDWR, 0o644)
    except OSError as error:
        raise InputError(f"out: {folder} cannot be written: {error.strerror or error}") from error
    try:
        _lock(lock, folder)
        store = Store(folder)
        shutil.rmtree(store.scratch, ignore_errors=True)
        for part in folder.rglob(".*.part"):
            part.unlink(missing_ok=True)
        yield store
    finally:
        os.close(lock)
        if made:
            _remove_if_empty(folder)


def _remove_if_empty(folder: Path) -> None:
    """A sweep that was refused before it had a result leaves nothing."""
    runs, small = folder / "runs", (folder / MARK_FILE, folder / LOCK_FILE)
    if any(runs.iterdir()) or set(folder.iterdir()) - {runs, *small}:
        return
    for path in small:
        path.unlink(missing_ok=True)
    runs.rmdir()
    folder.rmdir()


def _lock(lock: int, folder: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        owner = os.pread(lock, 32, 0).decode(errors="replace").strip()
        raise InputError(
            f"out: {folder} is in use by another sweep (process {owner or 'unknown'}); "
            "wait for it, or choose another folder"
        ) from error
    os.ftruncate(lock, 0)
    os.pwrite(lock, f"{os.getpid()}\n".encode(), 0)


def _check_folder(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise InputError(f"out: {folder} is a file, a folder was expected")
    mark = folder / MARK_FILE
    if mark.exists():
        check(read_json(mark).get("schema") == SCHEMA, mark, "schema", f'"{SCHEMA}"')
    # Without a mark: a sweep that was killed at its very start has made these two.
    elif folder.is_dir() and not {path.name for path in folder.iterdir()} <= {LOCK_FILE, "runs"}:
        raise InputError(
            f"out: {folder} holds files but no {MARK_FILE}; "
            "a new or empty folder or one of an earlier sweep was expected"
        )


# --- the table ------------------------------------------------------------------------------------


def table_of(rows: Sequence[Row]) -> Mapping[str, list[Cell]]:
    """Columns by name: the configuration, how the run ended, and every number of its metrics."""
    configs = [config_values(row.config) for row in rows]
    columns: dict[str, list[Cell]] = {
        name: [c[name] for c in configs]  # type: ignore[misc]
        for name in CONFIG_COLUMNS
    }
    columns |= {"status": [r.status for r in rows], "error": [r.error for r in rows]}
    for name in metric_names():
        if name not in columns:
            columns[name] = [None if r.metrics is None else value_of(r.metrics, name) for r in rows]
    return columns


def csv_text(table: Mapping[str, Sequence[Cell]]) -> str:
    """A table as CSV; what does not apply is empty."""
    text = io.StringIO()
    lines = csv.writer(text, lineterminator="\n")
    lines.writerow(table)
    for row in zip(*table.values(), strict=True):
        lines.writerow(["" if cell is None else cell for cell in row])
    return text.getvalue()


def _write_parquet(table: Mapping[str, Sequence[Cell]], path: Path) -> bool:
    """Writes a table as Parquet; False where pyarrow is not there."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        return False
    with whole_file(path) as part:
        pyarrow.parquet.write_table(pyarrow.table(dict(table)), part)
    return True
