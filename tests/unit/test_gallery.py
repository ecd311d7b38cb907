"""The gallery of the site: no rule, no part of the assumption and no end of a controller's lacks a page."""

from __future__ import annotations

import json
from pathlib import Path

from dubins_traffic.record.sink import FAULTS, End
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.scoring.verdict import ASSUMPTIONS, assumption_of

CASES = json.loads((Path(__file__).parents[2] / "website" / "gallery.json").read_text(encoding="utf-8"))
ELSEWHERE = {
    End.AGENT_FAULT,
    End.PEER_SILENT,
    End.PEER_LOST,
    End.PEER_FLOOD,
    End.PEER_GARBAGE,
    End.TRANSPORT_LOST,
    End.WORLD_LOST,
    End.OUT_OF_TIME,
    End.OUT_OF_MEMORY,
    End.OUTPUT_FLOOD,
    End.BOX_FAILED,
}
"""Faults of e-agents, other processes, boxes and worlds: no controller that is loaded brings them about."""


def test_every_rule_has_a_page() -> None:
    """A page of a rule of the ego, and one of each part of the assumption, in which an e-agent breaks it."""
    own = {case["shows"] for case in CASES if case["own"]}
    others = {case["shows"] for case in CASES if not case["own"]}
    assert {rule for rule in RULES if not rule.startswith("E")} <= own
    assert {rule for rule in RULES if rule.startswith("E")} <= others
    assert {assumption_of(name) for name in others} == set(ASSUMPTIONS)


def test_every_failure_has_a_page() -> None:
    shown = {case["shows"] for case in CASES}
    assert {end.value for end in FAULTS - ELSEWHERE} | {End.COLLISION, End.GAVE_UP} <= shown
    assert {"satisfied", "excused", "unfinished"} <= shown


def test_pages_are_called_as_what_they_show() -> None:
    """`gallery.py` refuses to build a page that does not show it."""
    assert [case["name"] for case in CASES] == [case["shows"] for case in CASES]
    assert len({case["name"] for case in CASES}) == len(CASES)
