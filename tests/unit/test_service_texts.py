"""Texts of organisers hold no HTML of theirs; a table for spreadsheets holds no formula."""

from __future__ import annotations

import csv
import re

import pytest

from dubins_traffic.service.texts import csv_of, html_of

NASTY = [
    "<script>alert(1)</script>",
    '<img src=x onerror="alert(1)">',
    '<a href="javascript:alert(1)">x</a>',
    "[x](javascript:alert(1))",
    "[x](data:text/html;base64,PHNjcmlwdD4=)",
    "[x](JaVaScRiPt:alert(1))",
    "[x](&#106;avascript:alert(1))",
    "[x](//evil.example)",
    "<javascript:alert(1)>",
    "[x]\n\n[x]: vbscript:alert(1)",
    '[x](https://ok.example "\\" onclick=\\"alert(1)")',
    "![x](https://evil.example/pixel.png)",
    '```"><script>alert(1)</script>\nx\n```',
    "<div onclick=alert(1)>\nblock\n</div>",
    "|a|\n|:-:|\n|<b onclick=x>|",
]


@pytest.mark.parametrize("text", NASTY)
def test_nothing_of_a_text_is_html_of_its_own(text: str) -> None:
    made = html_of(text)
    tags = re.findall(r"<[^>]*>", made)
    assert all(
        re.fullmatch(r'</?(p|a|pre|code|table|thead|tbody|tr|th|td|br)( (href|title|class)="[^"<>]*")*\s*/?>', tag)
        for tag in tags
    ), made
    assert all(link.startswith(("https://", "http://")) for link in re.findall(r'href="([^"]*)"', made))
    assert "<img" not in made


def test_a_text_has_headings_below_the_page_s_own_and_links_to_the_web() -> None:
    made = html_of("# Rules\n\n*Drive* [well](https://example.org)\n\n|a|\n|-:|\n|1|")
    assert "<h2>Rules</h2>" in made
    assert '<em>Drive</em> <a href="https://example.org">well</a>' in made
    assert "<td>1</td>" in made
    assert "style" not in made


@pytest.mark.parametrize("name", ["=cmd|' /C calc'!A0", "+1", "-1", "@SUM(1)", "\t=1"])
def test_a_name_is_no_formula(name: str) -> None:
    row = {"place": 1, "entry": name, "trials": 2, "mean": 1.0, "interval": None, "submission": 3}
    row |= {"rounds_before_breach": 1.0, "satisfied": 1.0, "clean": None, "cut": 0}
    _, (_, entry, *_rest) = csv.reader(csv_of([row]).splitlines())
    assert entry == f"'{name}"
