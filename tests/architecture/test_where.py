"""Each clause of the rules and each word of the glossary has one place in the package, and docs/where.md names it.

A clause is implemented where a docstring names it after the word ``Norm:``; others may cite it as they like. Slow
references in tests state clauses a second time, on purpose; they are no part of the package.
"""

from __future__ import annotations

import ast
import re
from collections import Counter

from tests.architecture.house import PACKAGE, ROOT, modules

PAGE = (ROOT / "docs" / "where.md").read_text(encoding="utf-8")
RULES = (ROOT / "docs" / "rules.md").read_text(encoding="utf-8")
TOWN_PAGES = [ROOT / "docs" / "architecture.md", *(ROOT / "docs" / "architecture").glob("*.md")]
TOWN = "\n".join(path.read_text(encoding="utf-8") for path in TOWN_PAGES)
HEADINGS = {"ground", "propositions", "1", "2", "3", "E3", "why", "verdicts", "reports"}
"""Anchors of the rules that head others, or say why."""
CITED = re.compile(r"docs/rules\.md#([\w.-]*\w)")
NORM = re.compile(r"Norm: (docs/rules\.md#[\w.-]*\w(?:,\s+docs/rules\.md#[\w.-]*\w)*)")


def listed(heading: str) -> list[tuple[str, str]]:
    """Return the rows of the table below a heading of the page: what is looked for, and its place."""
    part = PAGE.split(f"## {heading}\n")[1].split("\n## ")[0]
    return re.findall(r"^\| (?:\[)?(.+?)(?:\]\(rules\.md#.*\))? \| `([\w.]+)` \|$", part, re.MULTILINE)


def docstring_at(place: str) -> str | None:
    """Return the docstring of a module, or of a class, function or constant in it; None if there is no such place."""
    files = {module.name: module.tree for module in modules()}
    parts = place.split(".")
    for count in range(len(parts), 0, -1):
        tree = files.get(".".join(parts[:count]))
        if tree is not None:
            return _below(tree, parts[count:])
    return None


def _below(node: ast.AST, names: list[str]) -> str | None:
    if not names:
        return ast.get_docstring(node) if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) else None
    body: list[ast.stmt] = getattr(node, "body", [])
    for part, after in zip(body, [*body[1:], None], strict=True):
        if getattr(part, "name", None) == names[0]:
            return _below(part, names[1:])
        target = part.targets[0] if isinstance(part, ast.Assign) else getattr(part, "target", None)
        if isinstance(target, ast.Name) and target.id == names[0] and len(names) == 1:
            said = after.value if isinstance(after, ast.Expr) else None
            return said.value if isinstance(said, ast.Constant) and isinstance(said.value, str) else ""
    return None


def stated(text: str) -> list[str]:
    """Return the clauses that a text says it implements."""
    return [anchor for found in NORM.findall(text) for anchor in CITED.findall(found)]


def test_each_clause_has_one_place_which_cites_it() -> None:
    anchors = set(re.findall(r'<a id="([^"]+)">', RULES)) - HEADINGS
    rows = listed("A clause of the rules")
    assert {anchor for anchor, _ in rows} == anchors
    assert Counter(anchor for anchor, _ in rows).most_common(1)[0][1] == 1
    for anchor, place in rows:
        assert anchor in stated(docstring_at(place) or ""), (anchor, place)


def test_no_other_place_says_that_it_implements_a_clause() -> None:
    found = Counter(anchor for module in modules() for anchor in stated(module.text))
    assert {anchor: count for anchor, count in found.items() if count > 1} == {}
    assert len(found) > 60


def test_each_word_and_each_question_has_a_place_that_is_there() -> None:
    rows = [*listed("A word"), *listed("A verb"), *listed("A question")]
    assert len(rows) > 60
    assert len({word for word, _ in rows}) == len(rows)
    assert [(word, place) for word, place in rows if docstring_at(place) is None] == []


FOUND_BY_NAMES = 15
"""So many questions at least lead to their place by the words that they ask for."""
SMALL_WORDS = {
    "where",
    "what",
    "does",
    "come",
    "from",
    "kept",
    "made",
    "that",
    "above",
    "looked",
    "whether",
    "decided",
}


def leads_to(question: str, place: str) -> bool:
    """Tell whether a word of a question stands in the place's name, or in its room's row on the pages of the town."""
    room, *rest = place.split(".")
    rows = [line for line in TOWN.splitlines() if f"`{room}`" in line[2:].partition(" | ")[0]]
    text = " ".join([*rows, *rest]).lower().replace("_", " ")
    words = {word[:5] for word in re.findall(r"[a-z]{4,}", question.lower()) if word not in SMALL_WORDS}
    return any(word in text for word in words)


def test_questions_lead_to_their_places_by_names_and_the_pages_of_the_buildings_alone() -> None:
    rows = listed("A question")
    assert sum(leads_to(question, place) for question, place in rows) >= FOUND_BY_NAMES
    assert not leads_to("Where is the ticket order kept?", "cars.motion")


def test_all_words_of_the_glossary_are_listed() -> None:
    glossary = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8").split("\n## Code")[0]
    cells = re.findall(r"^\| (?!word|---)(.+?) \| ", glossary, re.MULTILINE)
    words = {_plain(word) for cell in cells for word in cell.split(", ") if word != "v)"}
    rows = [*listed("A word"), *listed("A verb"), *listed("A clause of the rules")]
    assert len(words) > 70
    assert words - {_plain(word) for word, _ in rows} == set()


def _plain(word: str) -> str:
    """Return a word without its link and what stands in brackets behind it."""
    text = re.sub(r"\[(.+?)\]\(.*?\)", r"\1", word)
    return text.partition(" (")[0].replace("-", " ")


def test_a_second_place_is_found() -> None:
    assert stated("Norm: docs/rules.md#E4, docs/rules.md#pause.") == ["E4", "pause"]
    assert stated("as docs/rules.md#E4 has it") == []
    assert docstring_at("rules.nowhere.judge") is None
    assert PACKAGE.is_dir()
