"""The page of a search: every cell in words, warnings, nothing from elsewhere."""

import base64
import hashlib
import re

from dubins_traffic.falsification.archive import coverage_page
from dubins_traffic.falsification.case import Case, Story
from dubins_traffic.falsification.coverage import Cell, Manoeuvre, Row
from dubins_traffic.problem.draw import draw
from tests.minute import a_minute

NASTY = "</style><script>alert(1)</script><img src=http://x.example>"
SETTINGS = {"controller": NASTY, "targets": ["3.clear"], "seed": 7, "strategy": "evolution"}
COUNTS = {"trials": 1234, "violated": 2, "discarded": 3, "faulty": 4, "unconfirmed": 5}
ROWS = [
    Row(Cell("1.road", Manoeuvre.DRIVING, 3), 12, 0),
    Row(Cell("3.clear", Manoeuvre.LEFT, 3), 0, 0),
    Row(Cell("3.clear", Manoeuvre.LEFT, 4), 5, 2),
]
CASE = Case(draw(a_minute("junction"), 1, 0), Story("3.clear", "left", 4, "x", 2.0, 60, NASTY))


def test_each_cell_stands_in_words_and_an_empty_one_is_a_warning() -> None:
    page = coverage_page(SETTINGS, COUNTS, ROWS, {"3.clear-left-4": CASE}, {"3.clear-left-4": 17})
    assert "1 of 3 cells were never put to the test: 3.clear left, 3 roads." in page
    assert page.count("never tested</b>") == 1
    assert "tested 5, <b>broken 2</b>" in page
    cells = re.findall(r'<td data-head="(. roads)">(?:<[^>]*>)?([^<]*)', page)
    told = [
        ("3 roads", "tested 12"),
        ("4 roads", "none expected"),
        ("3 roads", "\N{WARNING SIGN} never tested"),
    ]
    assert cells == [*told, ("4 roads", "tested 5, ")]
    assert "1,234" in page
    assert '<a href="cases/3.clear-left-4.json">' in page


def test_the_page_asks_for_nothing_else_and_runs_nothing_that_a_name_says() -> None:
    page = coverage_page(SETTINGS, COUNTS, ROWS, {"3.clear-left-4": CASE}, {})
    assert "<script" not in page
    assert "<img" not in page
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)
    assert policy
    assert "default-src 'none'" in policy[1]
    style = page.split("<style>", 1)[1].split("</style>", 1)[0]
    digest = base64.b64encode(hashlib.sha256(style.encode()).digest()).decode()
    assert f"style-src 'sha256-{digest}'" in policy[1]
    assert ".never" in style


def test_a_search_that_found_nothing_and_left_nothing_out_says_so() -> None:
    page = coverage_page(SETTINGS, COUNTS, ROWS[:1], {}, {})
    assert 'class="warning"' not in page
    assert "Nothing. A search that finds nothing" in page
