"""A page out of a folder of tables (CSV) and pictures (PNG), as an ablation leaves them."""

from __future__ import annotations

from pathlib import Path

from eval.files import read_bytes, read_csv, write_text
from eval.report import html
from eval.report.run import REPORT_FILE
from slam.core import InputError


def write_ablation(folder: Path) -> Path:
    """Makes the page of the folder. Raises InputError where there is nothing to show."""
    path = folder / REPORT_FILE
    write_text(path, ablation_page(folder))
    return path


def ablation_page(folder: Path) -> str:
    """Pictures first, then the tables, each under its file's name."""
    pictures = sorted(folder.glob("*.png"))
    tables = [_table(path) for path in sorted(folder.glob("*.csv"))]
    if not (pictures or tables):
        raise InputError(f"{folder}: holds neither a run nor tables (.csv) of an ablation")
    figures = [html.figure(html.image(read_bytes(p), p.stem), p.name) for p in pictures]
    sections = [
        html.section("Pictures", *figures),
        html.section("Tables", *map(html.table, tables)),
    ]
    return html.page(folder.resolve().name, "Variants over scenes and seeds", sections)


def _table(path: Path) -> html.Table:
    rows = read_csv(path)
    return html.Table(path.name, rows[0] if rows else (), rows[1:])
