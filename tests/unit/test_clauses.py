"""Every clause that code, documentation and tests cite is an anchor of docs/rules.md, and every breach names one."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.clauses import PAGE, clause
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES

ROOT = Path(__file__).parents[2]
ANCHORS = re.findall(r'<a id="([^"]+)"></a>', (ROOT / PAGE).read_text(encoding="utf-8"))
CITED = re.compile(r"rules\.md#([\w.-]*\w)")
LINK = re.compile(r"\]\(([^)\s:#]*)#([^)\s]+)\)")
HEADING = re.compile(r"^#+ (.*)$", re.MULTILINE)
PLACES = {
    "src": "*.py",
    "docs": "*.md",
    "tests": "*.py",
    "benchmarks": "*.py",
    "experiments": "*.py",
    "examples": "*.py",
}


def sources() -> list[Path]:
    found = [path for folder, pattern in PLACES.items() for path in (ROOT / folder).rglob(pattern)]
    return [*sorted(found), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


def anchors_of(page: Path) -> set[str]:
    """Return the anchors of a page: those that it names, and those that its headings have on the web."""
    text = page.read_text(encoding="utf-8")
    headings = [re.sub(r"<[^>]*>|[`*]", "", found) for found in HEADING.findall(text)]
    slugs = {re.sub(r"[^\w\- ]", "", found.lower()).strip().replace(" ", "-") for found in headings}
    return slugs | set(re.findall(r'<a id="([^"]+)"></a>', text))


def test_an_anchor_stands_for_one_clause():
    assert len(ANCHORS) == len(set(ANCHORS))


def test_every_cited_clause_exists():
    cited = [(path, name) for path in sources() for name in CITED.findall(path.read_text(encoding="utf-8"))]
    assert len(cited) > 60
    unknown = sorted(f"{path.relative_to(ROOT)}: {name}" for path, name in cited if name not in ANCHORS)
    assert not unknown


def test_code_cites_clauses_and_not_the_page_of_before():
    """No docstring says RULES for the page: that name is the tuple of rules in the breach log."""
    old = re.compile(r"RULES\.md|\(RULES,|\b(?:in|of|as|than) RULES\b")
    named = [path for path in (ROOT / "src").rglob("*.py") if old.search(path.read_text(encoding="utf-8"))]
    assert not named


@pytest.mark.parametrize("rule", sorted({*RULES, *EGO_RULES, *ASSUMPTIONS}))
def test_every_rule_that_a_breach_can_name_has_its_clause(rule: str):
    assert clause(rule).removeprefix(f"{PAGE}#") in ANCHORS


def test_links_between_pages_meet_their_anchors():
    pages = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    broken: list[str] = []
    for page in pages:
        for target, anchor in LINK.findall(page.read_text(encoding="utf-8")):
            other = (page.parent / target).resolve() if target else page
            if not other.exists() or anchor not in anchors_of(other):
                broken.append(f"{page.relative_to(ROOT)}: {target}#{anchor}")
    assert not broken
