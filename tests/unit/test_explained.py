"""What `explain` says of a rule, and that messages lead to it and to no page that a wheel does not have."""

from __future__ import annotations

import ast
import re
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
import typer

from dubins_traffic.cli.commands import app
from dubins_traffic.cli.main import main
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.clauses import explain
from dubins_traffic.rules.explained import MEANINGS, explained
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES

SRC = Path(__file__).parents[2] / "src" / "dubins_traffic"


@pytest.mark.parametrize("name", sorted({*RULES, *EGO_RULES, *ASSUMPTIONS}))
def test_every_rule_that_a_breach_names_has_a_meaning_and_a_norm(name: str) -> None:
    clause = explained(name)
    assert clause.meaning.endswith(".")
    assert clause.norm[0]
    assert not any(sign in text for text in clause.norm for sign in ("<a id", "](", "**"))


def test_a_clause_comes_with_the_items_below_it() -> None:
    room = explained("room")
    assert room.meaning == ""
    assert room.norm[0].startswith("Room. Rules 2 and 3 are defined only where all of this holds")
    assert any(text.startswith("Segments are at least") for text in room.norm)
    assert explained("3.stop").norm == explained("3.clear").norm


def test_the_command_says_it_and_names_the_site(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", "3.stop"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("3.stop: Before it enters a crossing, the ego stops")
    assert "The norm: At crossings:" in said
    (address,) = [
        line.split(", ")[1]
        for line in metadata.metadata("dubins-traffic").get_all("Project-URL") or []
        if line.startswith("Homepage, ")
    ]
    assert said.rstrip().endswith(address)
    assert max(map(len, said.split("\n"))) <= 80
    assert main(["explain"]) == 0
    lines = capsys.readouterr().out.split("\n")
    assert {line.split()[0] for line in lines if line and line[0] != " "} == set(MEANINGS)
    assert main(["explain", "9.fly"]) == 2
    assert "no such clause: got '9.fly'; expected one of 1.collision" in capsys.readouterr().err


def test_no_message_names_a_page_of_the_clone() -> None:
    """Docstrings may: they are read beside the sources. `rules.clauses.PAGE` is what docstrings cite by."""
    named: list[str] = []
    for path in sorted(SRC.rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        plain = {
            id(node.value)
            for node in ast.walk(tree)
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        }
        for node in ast.walk(tree):
            is_text = isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in plain
            if is_text and "docs/" in node.value:
                named.append(f"{path.relative_to(SRC)}:{node.lineno}: {node.value}")
    assert named == ["rules/clauses.py:7: docs/rules.md"]


def commands(command: Any) -> list[Any]:
    below = getattr(command, "commands", {}).values()
    return [command, *(own for one in below for own in commands(one))]


def test_no_help_names_a_page_of_the_clone() -> None:
    found = commands(typer.main.get_command(app))
    assert len(found) > 40
    for command in found:
        texts = [command.help or "", *(getattr(own, "help", None) or "" for own in command.params)]
        assert not [text for text in texts if "docs/" in text], command.name


def test_a_message_leads_to_a_clause_that_there_is() -> None:
    cited = {
        found
        for path in SRC.rglob("*.py")
        for found in re.findall(r"dubins-traffic explain ([\w.-]+)", path.read_text(encoding="utf-8"))
    }
    assert "room" in cited
    for name in cited:
        assert explained(name).norm
    assert explain("E4") == "dubins-traffic explain E4"
