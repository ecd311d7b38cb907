"""Verdicts against MONA's automata for finite words: what is presumed is what the word so far satisfies."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from random import Random

import pytest

from dubins_traffic.logic.automaton import PRESUMABLY_FALSE, PRESUMABLY_TRUE, automaton
from dubins_traffic.logic.formula import Bounds, Formula, Op, always, eventually, subformulas
from dubins_traffic.logic.rewrite import until_and_release_only
from tests.crosscheck.test_monitors_lasso import NAMES, verdicts
from tests.formulas import drawn, drawn_past
from tests.tools import interpreter_with, program

pytestmark = pytest.mark.tools

SCRIPT = Path(__file__).with_name("mona_acceptance.py")
SIGNS = {Op.AND: "&", Op.OR: "|", Op.Z: "WY", Op.T: "P"}
WORDS = 6


def accepted(questions: list[tuple[str, str, list[list[int]]]]) -> list[list[bool]]:
    program("mona")
    ran = subprocess.run(
        [interpreter_with("ltlf2dfa"), str(SCRIPT)],
        input=json.dumps({"names": NAMES, "formulas": questions}),
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    answers: list[list[bool]] = json.loads(ran.stdout.strip().splitlines()[-1])
    return answers


def written(f: Formula) -> str:
    """Return a formula as ltlf2dfa reads it: bounds by next, which is strong below F and U and weak below G and R."""
    if f.op is Op.PROP:
        return f.name
    if f.op in (Op.TRUE, Op.FALSE):
        return "(a | !a)" if f.op is Op.TRUE else "(a & !a)"
    parts = [written(arg) for arg in f.args]
    if f.bounds is not None:
        return bounded(f.op, parts, f.bounds)
    if len(parts) == 1:
        return f"({SIGNS.get(f.op, f.op.value)}({parts[0]}))"
    sign = SIGNS.get(f.op, f.op.value)
    return "(" + f" {sign} ".join(f"({part})" for part in parts) + ")"


def bounded(op: Op, parts: list[str], bounds: Bounds) -> str:
    low, high = int(bounds[0]), int(bounds[1])
    left, right = parts if len(parts) == 2 else ("", parts[0])
    strong = op in (Op.F, Op.U)
    join, step = ("|", "X") if strong else ("&", "WX")
    keep = "&" if strong else "|"
    found = right
    for place in range(high - 1, -1, -1):
        later = f"{step}({found})"
        if left:
            later = f"(({left}) {keep} {later})"
        found = f"({right} {join} {later})" if place >= low else f"({later})"
    return found


def random_words(random: Random) -> list[list[int]]:
    return [[random.randrange(4) for _ in range(random.randint(1, 6))] for _ in range(WORDS)]


def compared(formula: Formula, judged: Formula, words: list[list[int]], answer: list[bool]) -> tuple[int, int]:
    """Return how many verdicts on `judged` were presumed and definite; they are those of `formula` on finite words.

    A definite verdict tells of all continuations, so it is the same only if no next and no yesterday looks beyond
    the last letter.
    """
    still = all(part.op not in (Op.X, Op.Y, Op.Z) and part.bounds is None for part in subformulas(formula))
    table = automaton(judged, 1.0, 10)
    presumed = definite = 0
    for word, holds in zip(words, answer, strict=True):
        verdict = verdicts(table, word)[-1]
        if verdict in (PRESUMABLY_FALSE, PRESUMABLY_TRUE) or still:
            assert holds == (verdict >= PRESUMABLY_TRUE), f"{formula} after {word}"
        presumed += verdict in (PRESUMABLY_FALSE, PRESUMABLY_TRUE)
        definite += verdict not in (PRESUMABLY_FALSE, PRESUMABLY_TRUE) and still
    return presumed, definite


def test_what_is_presumed_is_what_mona_accepts() -> None:
    random = Random(8)
    asked: list[tuple[Formula, list[list[int]]]] = []
    for number in range(500):
        formula = drawn(random, random.randint(1, 3), NAMES, past=False, bounds=number % 3 == 0)
        asked.append((until_and_release_only(formula), random_words(random)))
    answers = accepted([("ltlf", written(formula), words) for formula, words in asked])
    counts = [
        compared(formula, formula, words, answer) for (formula, words), answer in zip(asked, answers, strict=True)
    ]
    assert sum(presumed for presumed, _ in counts) > 400
    assert sum(definite for _, definite in counts) > 400


def test_past_operators_as_mona_reads_them() -> None:
    """Of what recurs it is presumed that it stays as it is at the last letter."""
    random = Random(9)
    asked = [(drawn_past(random, random.randint(1, 3), NAMES), random_words(random)) for _ in range(150)]
    answers = accepted([("pltlf", written(formula), words) for formula, words in asked])
    counts = [
        compared(formula, always(eventually(formula)), words, answer)
        for (formula, words), answer in zip(asked, answers, strict=True)
    ]
    assert sum(presumed for presumed, _ in counts) > 400
    assert 0 < sum(map(sum, answers)) < WORDS * len(asked)
