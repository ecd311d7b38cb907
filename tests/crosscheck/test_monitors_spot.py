"""Verdicts against Spot: after words of up to four letters, exactly as early and never wrong."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from random import Random

import pytest

from dubins_traffic.logic.automaton import FALSE, TRUE, automaton
from dubins_traffic.logic.formula import Brackets, Formula, Op, Style, until, written
from dubins_traffic.logic.rewrite import in_ticks, mapped, until_and_release_only, written_out
from tests.crosscheck.test_monitors_lasso import NAMES, verdicts
from tests.formulas import drawn
from tests.tools import interpreter_with

pytestmark = pytest.mark.tools

SCRIPT = Path(__file__).with_name("spot_verdicts.py")
STORM = Style(
    {Op.AND: "&", Op.OR: "|", Op.TRUE: '("a" | !"a")', Op.FALSE: '("a" & !"a")'},
    Brackets.ALL,
    name=lambda name: f'"{name}"',
)


def for_storm(formula: Formula) -> str:
    """Return a formula with the operators that Storm reads."""

    def change(part: Formula) -> Formula:
        args = part.args
        if part.op is Op.IMPLIES:
            return ~args[0] | args[1]
        if part.op is Op.IFF:
            return (args[0] & args[1]) | (~args[0] & ~args[1])
        if part.op is Op.R:
            return ~until(~args[0], ~args[1])
        return part

    return written(mapped(until_and_release_only(written_out(in_ticks(formula, 1.0))), change), STORM)


def by_spot(questions: list[tuple[Formula, list[int]]]) -> list[list[int] | None]:
    request = {"names": NAMES, "formulas": [(for_storm(formula), tail) for formula, tail in questions]}
    ran = subprocess.run(
        [interpreter_with("stormpy"), str(SCRIPT)],
        input=json.dumps(request),
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    answers: list[list[int] | None] = json.loads(ran.stdout.strip().splitlines()[-1])
    return answers


@pytest.mark.parametrize("block", range(4))
def test_two_thousand_formulas_as_spot_judges_them(block: int) -> None:
    random = Random(block)
    questions: list[tuple[Formula, list[int]]] = []
    for number in range(505):
        formula = drawn(random, random.randint(1, 4), NAMES, past=False, bounds=number % 4 == 0)
        questions.append((formula, [random.randrange(4) for _ in range(random.randint(0, 3))]))
    undecided = judged = 0
    for (formula, tail), expected in zip(questions, by_spot(questions), strict=True):
        if expected is None:
            continue
        judged += 1
        table = automaton(formula, 1.0, 10)
        for first, verdict in enumerate(expected):
            found = verdicts(table, [first, *tail])[-1]
            assert (found if found in (FALSE, TRUE) else 1) == verdict, f"{formula} after {[first, *tail]}"
            undecided += verdict == 1
    assert judged >= 500
    assert undecided > 250
