"""A page out of sections, tables and pictures. Every text is escaped here and nowhere else."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

STYLE = """
:root{color-scheme:light dark;--ink:#1b1f24;--dim:#5c6672;--paper:#fff;--card:#f4f6f8;
--line:#d5dbe1;--good:#12803c;--bad:#c4291c;--estimate:#1f6fb4;--odometry:#7a52a8;--true:#6b7280}
@media(prefers-color-scheme:dark){:root{--ink:#e7eaee;--dim:#9aa5b1;--paper:#14171b;
--card:#1d2127;--line:#343b44;--good:#4cc07a;--bad:#ff7a6b;--estimate:#5fb0f2;--odometry:#b794e6;--true:#a3acb8}}
*{box-sizing:border-box}
body{margin:0 auto;max-width:60rem;padding:1rem;background:var(--paper);color:var(--ink);
font:1rem/1.5 system-ui,sans-serif}
h1{font-size:1.5rem;margin:.5rem 0}h2{font-size:1.15rem;margin:2rem 0 .5rem}
p{margin:.4rem 0}.dim,figcaption,caption{color:var(--dim);font-size:.9rem}
.cards{display:grid;grid-template-columns:repeat(auto-fill,minmax(8.5rem,1fr));gap:.6rem}
.card{background:var(--card);border-radius:.5rem;padding:.6rem .8rem}
.card b{display:block;font-size:1.25rem;line-height:1.3;white-space:nowrap}
figure{margin:.6rem 0}svg,img{width:100%;height:auto;max-height:44rem;display:block}
svg.chart{max-width:38rem}img{object-fit:contain;background:#fff;border-radius:.5rem}
.key{display:inline-block;white-space:nowrap;margin-left:.5rem}
.key i{display:inline-block;width:1.4rem;height:.35rem;margin-right:.3rem;vertical-align:middle}
summary{font-size:1.15rem;font-weight:600;margin:1.5rem 0 .5rem;cursor:pointer}
ul{margin:.4rem 0;padding-left:1.2rem}
.scroll{overflow-x:auto}table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}
caption{text-align:left}td,th{padding:.25rem .6rem .25rem 0;border-bottom:1px solid var(--line);
text-align:left;vertical-align:top}details td{overflow-wrap:anywhere}th{font-weight:600}
.good{color:var(--good)}.bad{color:var(--bad)}
svg text{fill:var(--ink);font-family:system-ui,sans-serif;stroke:var(--paper);stroke-width:.2em;
stroke-linejoin:round;paint-order:stroke}svg .dim{fill:var(--dim)}
"""


@dataclass(frozen=True)
class Table:
    """caption: what it holds; header: names of columns; rows: texts."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[str]]


def page(title: str, lead: str, sections: Sequence[str]) -> str:
    """A whole document. sections: HTML."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{STYLE}</style></head>\n<body><main>"
        f'<h1>{escape(title)}</h1>\n<p class="dim">{escape(lead)}</p>\n'
        + "\n".join(sections)
        + "\n</main></body></html>\n"
    )


def section(title: str, *parts: str) -> str:
    """A heading and what stands below it; nothing if nothing does."""
    body = "\n".join(part for part in parts if part)
    return f"<section><h2>{escape(title)}</h2>\n{body}</section>" if body else ""


def folded(title: str, part: str) -> str:
    """What few ask for: a heading that opens it."""
    return f"<details><summary>{escape(title)}</summary>\n{part}</details>"


def items(texts: Sequence[str]) -> str:
    """A list; nothing without texts."""
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in texts)}</ul>" if texts else ""


def paragraph(text: str, kind: str = "") -> str:
    """kind: "", "good", "bad" or "dim"."""
    return f'<p class="{escape(kind)}">{escape(text)}</p>'


def cards(values: Sequence[tuple[str, str]]) -> str:
    """Names and values that are seen first."""
    each = (f'<div class="card"><b>{escape(v)}</b>{escape(k)}</div>' for k, v in values)
    return f'<div class="cards">{"".join(each)}</div>'


def table(content: Table) -> str:
    """The first column names its row."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in content.header)
    rows = (
        f'<tr><th scope="row">{escape(row[0])}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in content.rows
        if row
    )
    caption = f"<caption>{escape(content.caption)}</caption>"
    body = f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody>"
    return f'<div class="scroll"><table>{caption}{body}</table></div>'


def figure(picture: str, caption: str, key: Sequence[tuple[str, str]] = ()) -> str:
    """picture: HTML of an image or a drawing; key: colours and what they stand for."""
    keys = "".join(
        f'<span class="key"><i style="background:{escape(colour)}"></i>{escape(text)}</span>'
        for colour, text in key
    )
    return f"<figure>{picture}<figcaption>{escape(caption)}{keys}</figcaption></figure>"


def image(png: bytes, text: str) -> str:
    """A PNG inside the page; text: what it shows, for those who cannot see it."""
    return f'<img alt="{escape(text)}" src="data:image/png;base64,{b64encode(png).decode()}">'
