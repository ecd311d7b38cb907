"""Pieces of pages in HTML: sections, tables, and the whole document, which loads nothing from elsewhere."""

from __future__ import annotations

import base64
import hashlib
import html
from collections.abc import Iterable, Sequence
from importlib import resources


def document(title: str, style: str, head: str, sections: Sequence[str]) -> str:
    """Return a page; equal arguments give equal text.

    Parameters
    ----------
    title : str
        What a browser calls it.
    style : str
        Its style sheet.
    head : str
        What stands above the sections, in HTML.
    sections : sequence of str
        As `section` makes them.
    """
    policy = f"default-src 'none'; img-src data:; style-src '{_hash(style)}'"
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n'
        f"<title>{text(title)}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        f"{head}\n<main>\n{''.join(sections)}</main>\n</body>\n</html>\n"
    )


def base_style() -> str:
    """Return the style sheet that all reports have."""
    own = resources.files("dubins_traffic.campaign.report") / "report.css"
    return own.read_text(encoding="utf-8").strip()


def section(title: str, body: str) -> str:
    """Return a section under a heading."""
    return f"<section><h2>{text(title)}</h2>\n{body}</section>\n"


def table(head: Sequence[str], body: Iterable[Sequence[str]], kind: str = "") -> str:
    """Return a table; cells that begin with <th are whole elements, an empty first cell is spanned from above.

    Each cell repeats its heading, for narrow pages, on which the cells of a row stand below one another.
    """
    heading = "".join(f"<th>{text(cell)}</th>" for cell in head)
    labels = [text(cell) for cell in head]
    rows: list[str] = []
    for cells in body:
        spanned = kind == "grouped" and not cells[0]
        labelled = [
            cell if cell.startswith("<th") else f'<td data-head="{label}">{cell}</td>'
            for label, cell in zip(labels, cells, strict=True)
        ]
        rows.append("".join(labelled[spanned:]))
    lines = "\n".join(f"<tr>{row}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table class="{kind}"><thead><tr>{heading}</tr></thead>\n'
        f"<tbody>\n{lines}\n</tbody></table></div>"
    )


def text(words: str) -> str:
    """Return words as HTML shows them."""
    return html.escape(str(words))


def _hash(text: str) -> str:
    """Return the source expression of `text` for a Content-Security-Policy."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
