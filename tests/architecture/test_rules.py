"""What a rule of the road touches is what docs/extending/rule.md says, and nothing of a rule is missing."""

from __future__ import annotations

import re
from pathlib import Path

from dubins_traffic.rules.breach_log import RULE, RULES
from dubins_traffic.rules.explained import RULE_WORDS
from dubins_traffic.scoring.verdict import ASSUMPTIONS, EGO_RULES
from tests.added_rule import changed, copy_with_rule
from tests.architecture.house import PACKAGE, ROOT, modules

PAGE = (ROOT / "docs" / "extending" / "rule.md").read_text(encoding="utf-8")
LISTED = set(re.findall(r"^\| `src/dubins_traffic/([\w/]+\.py)`", PAGE, re.MULTILINE))
KNOW_SOME = re.compile(
    r"(shield|synthesis|envs|falsification)/|cli/estimate|scoring/(margins|verdict)|rules/(duties|task|referee\.)"
)
"""What knows some rules by name and need not know another, as the page says."""


def files_that_know(text: str) -> set[str]:
    pattern = re.compile(text)
    return {str(own.path.relative_to(PACKAGE)) for own in modules() if pattern.search(own.text)}


def test_a_rule_touches_the_files_that_the_page_lists() -> None:
    assert len(LISTED) == 5
    numbers = dict(zip(RULES, RULE._fields, strict=True))
    for rule in EGO_RULES:
        found = files_that_know(rf"\"{re.escape(rule)}\"|RULE\.{numbers[rule]}\b")
        assert {file for file in found if not KNOW_SOME.match(file)} <= LISTED, rule
        assert {"rules/breach_log.py", "rules/explained.py"} <= found, rule


def test_the_rule_of_the_example_changes_the_files_that_the_page_lists(tmp_path: Path) -> None:
    copy_with_rule(tmp_path, len(RULES))
    assert changed(tmp_path) == LISTED


def test_nothing_of_a_rule_is_missing() -> None:
    assert len(RULE) == len(RULES)
    assert set(RULE_WORDS) == set(RULES)
    anchors = set(re.findall(r'<a id="([^"]+)">', (ROOT / "docs" / "rules.md").read_text(encoding="utf-8")))
    assert set(RULES) <= anchors
    assert {rule.partition(".")[0] for rule in RULES if rule not in EGO_RULES} <= set(ASSUMPTIONS)
