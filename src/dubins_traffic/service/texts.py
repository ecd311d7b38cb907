"""Texts of organisers: Markdown as HTML that holds no HTML of theirs, no pictures, and links to the web alone.

Announcements as an Atom feed, and tables for spreadsheets.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from functools import cache
from typing import Any, Final
from xml.etree import ElementTree

from jinja2 import Environment, Undefined
from markupsafe import Markup

from dubins_traffic.campaign.columns import SECOND
from dubins_traffic.service.database_tables import Announcement
from dubins_traffic.service.viewing import iso
from dubins_traffic.viewer.pages import environment

ATOM: Final = "http://www.w3.org/2005/Atom"
COLUMNS: Final = (
    "place",
    "entry",
    "trials",
    "mean",
    "low",
    "high",
    SECOND,
    "satisfied",
    "clean",
    "cut",
    "submission",
)
FORMULAS: Final = ("=", "+", "-", "@", "\t", "\r")
"""How a text begins that a spreadsheet would compute."""


@cache
def _parser() -> Any:
    from markdown_it import MarkdownIt

    made = MarkdownIt("commonmark", {"html": False}).enable("table").disable(["image", "html_block", "html_inline"])
    made.validateLink = lambda url: url.lower().startswith(("https://", "http://"))  # pyright: ignore[reportAttributeAccessIssue]
    return made


def html_of(text: str) -> Markup:
    """Return a text in Markdown as HTML, whose headings stand below that of the page that shows it."""
    parser = _parser()
    tokens = parser.parse(text)
    for token in tokens:
        token.attrs.pop("style", None)  # columns of tables; no page of the service takes a style from a text
        if token.type.startswith("heading_"):
            token.tag = f"h{min(6, int(token.tag[1:]) + 1)}"
    return Markup(parser.renderer.render(tokens, parser.options, {}))


def moment(at: float | None) -> str:
    """Return a time as people read it, in UTC."""
    return "" if at is None else datetime.fromtimestamp(at, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


def span(seconds: float) -> str:
    """Return a time roughly, as people say it."""
    for unit, size in (("days", 86400.0), ("hours", 3600.0), ("minutes", 60.0)):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.0f} {unit}"
    return "a minute"


@cache
def templates() -> Environment:
    """Return the environment of the pages of the service."""
    made = environment().overlay(undefined=Undefined)  # forms are shown before and after they are filled in
    made.filters |= {"moment": moment, "markdown": html_of, "span": span}  # pyright: ignore[reportUnknownMemberType]
    return made


def feed(url: str, title: str, created: float, news: Sequence[Announcement]) -> bytes:
    """Return announcements, newest first, of a competition at an address as an Atom feed."""
    root = ElementTree.Element("feed", xmlns=ATOM)
    _put(root, "id", url)
    _put(root, "title", title)
    ElementTree.SubElement(root, "link", href=f"{url}/news.atom", rel="self")
    ElementTree.SubElement(root, "link", href=url)
    _put(root, "updated", iso(news[0].at if news else created) or "")
    _put(ElementTree.SubElement(root, "author"), "name", title)
    for one in news:
        entry = ElementTree.SubElement(root, "entry")
        where = f"{url}#news-{one.id}"
        _put(entry, "id", where)
        _put(entry, "title", one.title)
        ElementTree.SubElement(entry, "link", href=where)
        _put(entry, "updated", iso(one.at) or "")
        _put(entry, "content", html_of(one.text), type="html")
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


def _put(parent: ElementTree.Element, name: str, text: str, **attributes: str) -> None:
    ElementTree.SubElement(parent, name, attributes).text = "".join(
        letter for letter in text if letter.isprintable() or letter in "\n\t"
    )


def csv_of(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return places as comma-separated values; a name is never a formula."""
    made = io.StringIO()
    table = csv.writer(made)
    table.writerow(COLUMNS)
    for row in rows:
        low, high = row["interval"] or (None, None)
        full = {**row, "low": low, "high": high}
        name = f"'{row['entry']}" if row["entry"].startswith(FORMULAS) else row["entry"]
        table.writerow([name if column == "entry" else full[column] for column in COLUMNS])
    return made.getvalue()
