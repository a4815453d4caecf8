"""The page of every report: summary, sections, versions and the command that repeats it.

A section is a sequence of blocks: a string is a paragraph, a `Table` and a `Figure` are data, `Markup` is made here.

A report is one HTML file that loads nothing from elsewhere: style, script and the plotting library (packed,
once) are inside it, and its content security policy forbids the rest. All text is escaped here; only a
`Markup` made by this module passes unchanged.
"""

import base64
import functools
import html
import json
import math
import platform
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any, Literal

from ... import __version__
from ...core.files import write_whole
from .symbols import SYMBOLS

__all__ = [
    "Block",
    "Figure",
    "Headline",
    "Level",
    "Markup",
    "Page",
    "Section",
    "Table",
    "bar",
    "bullet_list",
    "details",
    "grid",
    "markup",
    "missing",
    "number",
    "paragraph",
    "plain_text",
    "render_page",
    "save_page",
    "shaded",
    "text",
    "versions",
]

Level = Literal["good", "attention", "bad", "plain"]
SIGNS: dict[Level, str] = {"good": "✓", "attention": "!", "bad": "✗", "plain": "i"}  # never colour alone


class Markup(str):
    """HTML that is already escaped."""


@dataclass(frozen=True)
class Figure:
    """An interactive figure: plotly traces and layout as dicts, and a description in words."""

    name: str
    title: str
    description: str
    traces: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any]
    height: int  # [CSS px]
    least_width: int = 0  # [CSS px] below which it scrolls sideways inside its own box


@dataclass(frozen=True)
class Table:
    """A table, for a report or a terminal; the first column heads its rows. Cells are text or `Markup`."""

    caption: str
    header: Sequence[str]
    rows: Sequence[Sequence[object]]


Block = str | Figure | Table


@dataclass(frozen=True)
class Headline:
    """A key figure: its value, label and reference for comparison."""

    value: str
    label: str
    note: str = ""
    level: Level = "plain"


@dataclass(frozen=True)
class Section:
    """A section of the page, with its entry in the navigation."""

    name: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True)
class Page:
    """Contents of a report, in reading order."""

    kind: str
    title: str
    purpose: str  # of the test or command, in a sentence
    verdict: str
    level: Level
    headlines: Sequence[Headline]
    sections: Sequence[Section]
    notes: Sequence[str] = ()
    command: str | None = None  # that repeats it
    versions: Mapping[str, str] = field(default_factory=lambda: versions())


def text(value: object) -> Markup:
    """Escape `value` for use in an element or a quoted attribute; a `Markup` is returned as it is."""
    return value if isinstance(value, Markup) else Markup(html.escape(str(value)))


def prose(value: object) -> Markup:
    """As `text`, what stands between backticks as code."""
    return value if isinstance(value, Markup) else Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", text(value)))


def number(value: float, digits: int = 3) -> str:
    """`value` with `digits` significant digits for reading; an en dash where it is not finite."""
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if abs(value) < 1e-4:
        return f"{value:.{digits - 1}e}".replace("-", "−")
    if abs(value) >= 10 ** (digits - 1):
        return f"{value:,.0f}".replace("-", "−")
    return f"{value:#.{digits}g}".rstrip(".").replace("-", "−")


def plain_text(cell: object) -> str:
    """Return a cell of a table as text without markup."""
    return html.unescape(re.sub(r"<[^>]*>", "", cell)) if isinstance(cell, Markup) else str(cell)


def markup(block: Block) -> Markup:
    """Return a block of a section as HTML."""
    if isinstance(block, Figure):
        return _figure(block)
    if isinstance(block, Table):
        return _table(block)
    return block if isinstance(block, Markup) else paragraph(block)


def paragraph(*parts: object) -> Markup:
    """Return one paragraph."""
    return Markup(f"<p>{''.join(map(prose, parts))}</p>")


def missing(names: Sequence[str], consequence: str) -> Markup:
    """Return a notice of the channels that a section needs and the record lacks."""
    codes = ", ".join(f"<code>{text(name)}</code>" for name in names)
    return Markup(f'<p class="missing"><strong>Not in the record:</strong> {codes}. {text(consequence)}</p>')


def bullet_list(items: Iterable[object]) -> Markup:
    """Return an unordered list."""
    return Markup("<ul>" + "".join(f"<li>{prose(item)}</li>" for item in items) + "</ul>")


def details(summary: str, *blocks: Block) -> Markup:
    """Return blocks that are collapsed on screen and open in print."""
    return Markup(f"<details><summary>{text(summary)}</summary>{''.join(map(markup, blocks))}</details>")


def grid(*blocks: Block, pairs: bool = False) -> Markup:
    """Return blocks side by side on wide screens; with `pairs`, at most two."""
    return Markup(f'<div class="{"grid pairs" if pairs else "grid"}">{"".join(map(markup, blocks))}</div>')


UNSEEN = 1e-6  # fraction of a limit that is shown as zero


def bar(fraction: float, tolerance: float = 0.0) -> Markup:
    """Return a bar filled to `fraction` of a limit, with the percentage as text.

    Hatched from the limit on, or from `tolerance` (a fraction of the limit) beyond it. Infinity: the limit is zero.
    """
    if fraction != fraction:
        return text("–")
    level = "over" if fraction >= 1.0 + tolerance else "near" if fraction >= 0.8 else "within"
    width = min(100.0 * fraction, 100.0)
    shown = 100.0 * fraction if fraction > UNSEEN else 0.0
    percent = f"{number(shown, 3 if fraction >= 1.0 else 2)} %" if fraction < float("inf") else "no capacity"
    return Markup(
        f'<span class="bar {level}"><span class="fill" style="width:{width:.1f}%"></span></span>'
        f'<span class="percent">{percent}</span>'
    )


def shaded(words: str, shade: int) -> Markup:
    """Return text on one of five shades of a hue, 0 the lightest."""
    return Markup(f'<span class="shade shade{shade}">{text(words)}</span>')


def _table(table: Table) -> Markup:
    """A table that scrolls sideways inside its own box."""
    head, caption = "".join(f'<th scope="col">{text(name)}</th>' for name in table.header), text(table.caption)
    body = "".join(
        f'<tr><th scope="row">{text(row[0])}</th>' + "".join(f"<td>{text(cell)}</td>" for cell in row[1:]) + "</tr>"
        for row in table.rows
    )
    return Markup(
        f'<div class="scroll" tabindex="0" role="region" aria-label="{caption}"><table>'
        f"<caption><span>{caption}</span></caption><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>"
    )


def _figure(drawing: Figure) -> Markup:
    """The element of a figure with its data; the page's script draws it when it scrolls into view."""
    data = json.dumps({"traces": drawing.traces, "layout": drawing.layout}, separators=(",", ":"))
    data = data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")
    name = text(drawing.name)
    size = f"height:{drawing.height}px"
    before, after = "", ""
    if drawing.least_width:
        size += f";min-width:{drawing.least_width}px"
        before, after = f'<div class="scroll" tabindex="0" role="region" aria-labelledby="{name}-caption">', "</div>"
    return Markup(
        f'<figure><figcaption id="{name}-caption"><h3>{text(drawing.title)}</h3>'
        f"<p>{text(drawing.description)}</p></figcaption>"
        f'{before}<div class="plot" id="{name}" style="{size}" tabindex="0" role="group" '
        f'aria-roledescription="interactive plot" aria-labelledby="{name}-caption" '
        f'aria-describedby="keys"></div>{after}'
        f'<script type="application/json" data-for="{name}">{data}</script></figure>'
    )


def versions() -> dict[str, str]:
    """Return the versions of this package, Python and the numerical libraries."""
    found = {"lhpost6-pin": __version__, "Python": platform.python_version()}
    for name in ("pin", "numpy", "scipy", "numba", "xarray", "plotly"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found | {"platform": platform.platform(terse=True)}


@functools.cache
def packed_plotly() -> str:
    """plotly.js as shipped with the plotly package: deflated, then base64 (a third of its plain size).

    Kept in the cache of compiled code, since packing takes longer than all else of a page.
    """
    from ...core.compiled import cache_folder

    folder = cache_folder()
    kept = None if folder is None else folder / f"plotly-{metadata.version('plotly')}.txt"
    if kept is not None and kept.is_file():
        return kept.read_text(encoding="ascii")
    from plotly.offline import get_plotlyjs

    packed = base64.b64encode(zlib.compress(get_plotlyjs().encode(), 4)).decode()
    if kept is not None:
        with suppress(OSError), write_whole(kept) as own:
            own.write_text(packed, encoding="ascii")
    return packed


def beside(name: str) -> str:
    """Return the text of a file of this folder."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def render_page(page: Page) -> str:
    """Return the whole report as HTML text."""
    symbols = details("What the symbols mean", Table("Symbols", ("Symbol", "Meaning"), SYMBOLS))
    ending = [Section("symbols", "Symbols", [symbols]), Section("repeat", "Versions and command", _repeat(page))]
    sections = [*page.sections, *ending]
    links = "".join(f'<li><a href="#{text(s.name)}">{text(s.title)}</a></li>' for s in sections)
    body = "".join(
        f'<section id="{text(s.name)}" aria-labelledby="{text(s.name)}-title">'
        f'<h2 id="{text(s.name)}-title">{text(s.title)}</h2>{"".join(map(markup, s.blocks))}</section>'
        for s in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; '
        "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:\">\n"
        f"<title>{text(page.title)} · {text(page.kind)}</title>\n"
        f"<style>{beside('page.css')}</style>\n</head>\n"
        '<body>\n<a class="skip" href="#main">Skip to the report</a>\n'
        f'<nav aria-label="Sections"><ul><li><a href="#main">Summary</a></li>{links}</ul></nav>\n'
        f'<main id="main" tabindex="-1">{_summary(page)}{body}</main>\n'
        '<p id="keys" hidden>Arrow keys move along the axis, plus and minus zoom, 0 shows all.</p>\n'
        f'<script type="application/octet-stream" id="library">{packed_plotly()}</script>\n'
        f"<script>{beside('page.js')}</script>\n</body>\n</html>\n"
    )


def save_page(page: Page, path: Path | str) -> Path:
    """Write the report to `path`, whole or not at all, and return the path."""
    target = Path(path)
    content = render_page(page)
    with write_whole(target) as temporary:
        temporary.write_text(content, encoding="utf-8")
    return target


def _summary(page: Page) -> str:
    tiles = "".join(
        f'<div class="tile {h.level}"><dt>{text(h.label)}</dt><dd><span class="value">{text(h.value)}</span>'
        f'<span class="note">{text(h.note)}</span></dd></div>'
        for h in page.headlines
    )
    notes = f"<h2>Notes from the run</h2>{bullet_list(page.notes)}" if page.notes else ""
    return (
        f'<header><p class="kind">{text(page.kind)}</p><h1>{text(page.title)}</h1>'
        f'<p class="purpose">{text(page.purpose)}</p>'
        f'<p class="verdict {page.level}"><span class="sign" aria-hidden="true">{SIGNS[page.level]}</span>'
        f'<span>{prose(page.verdict)}</span></p><dl class="tiles">{tiles}</dl>{notes}</header>'
        "<noscript><p class='missing'>Plots need JavaScript; the numbers are also in tables.</p></noscript>"
        "<p class='missing' id='no-plots' hidden></p>"
    )


def _repeat(page: Page) -> list[Block]:
    versions = Table("Versions", ("Software", "Version"), list(page.versions.items()))
    if not page.command:
        return [versions]
    code = f"<pre tabindex='0' aria-label='Command to repeat'><code>{text(page.command)}</code></pre>"
    return [Markup(code), versions]
