"""What is exported, read by the tools that it is for."""

from __future__ import annotations

import json
import re
import subprocess
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from dubins_traffic.logic.formula import SPIN, Brackets, Formula, Op, Style, subformulas, to_spin, written
from dubins_traffic.logic.parse import parse
from dubins_traffic.logic.rewrite import simplify, until_and_release_only
from dubins_traffic.logic.robustness import robustness
from dubins_traffic.specifications.exports import Specification, spin, stl, tulip
from tests.formulas import drawn
from tests.tools import interpreter_with, program

pytestmark = pytest.mark.tools

HERE = Path(__file__).parent
NAMES = ("a", "b")


def asked(tool: str, script: str, request: object) -> Any:
    ran = subprocess.run(
        [interpreter_with(tool), str(HERE / script)],
        input=json.dumps(request),
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert ran.returncode == 0, ran.stderr[-2000:]
    return json.loads(ran.stdout.strip().splitlines()[-1])


def spin_output(text: str) -> str:
    """Return what SPIN makes of a formula: a never claim."""
    ran = subprocess.run([program("spin"), "-f", text], capture_output=True, text=True, check=False, timeout=600)
    assert ran.returncode == 0, f"{text}: {ran.stdout}{ran.stderr}"
    assert "syntax error" not in ran.stdout, f"{text}: {ran.stdout}"
    return ran.stdout


def never_claim(text: str) -> str:
    """Return SPIN's automaton of a formula, without its first line and what is needless at literals."""
    claim, before = "".join(spin_output(text).splitlines()[1:]).replace(" ", ""), ""
    while claim != before:
        claim, before = re.sub(r"\((!*\w+|\(\w+\))\)", r"\1", claim).replace("!!", ""), claim
    return claim


def test_spin_reads_what_is_printed_as_it_is_meant() -> None:
    random = Random(5)
    signs = Style(SPIN.signs, Brackets.ALL)
    done = 0
    while done < 120:
        raw = drawn(random, random.randint(1, 3), ("a", "b", "c"), past=False, bounds=False)
        formula = simplify(until_and_release_only(raw))
        if any(part.op is Op.X for part in subformulas(formula)):
            continue
        assert never_claim(to_spin(formula)) == never_claim(written(formula, signs)), to_spin(formula)
        done += 1


def test_spin_reads_the_tasks_of_2016() -> None:
    task = parse("([]<> ego_t_2_0) && ([]<> ego_t_1_1) && ([]<> ego_t_0_2)")
    assert never_claim(spin(Specification((), (task,), (), tuple(f"ego_t_{p}" for p in ("2_0", "1_1", "0_2"))), 0.1))


def signals_formula(random: Random) -> Formula:
    while True:
        formula = drawn(random, random.randint(1, 4), NAMES, past=random.random() < 0.5, bounds=True, longest=6)
        if not any(part.op in (Op.TRUE, Op.FALSE) for part in subformulas(formula)):
            return formula


def test_robustness_as_rtamt_computes_it() -> None:
    random = Random(11)
    formulas = [signals_formula(random) for _ in range(300)]
    frames = 14
    draws = np.random.default_rng(3).integers(-50, 50, size=(2, frames)) / 8.0
    signals = dict(zip(NAMES, draws, strict=True))
    for period_ms in (1000, 500):
        period = period_ms / 1000
        texts = [stl(Specification((), (formula,), NAMES, ()), period) for formula in formulas]
        request = {
            "period_ms": period_ms,
            "signals": {name: signal.tolist() for name, signal in signals.items()},
            "formulas": texts,
        }
        (answer,) = asked("rtamt", "rtamt_robustness.py", [request])
        for formula, expected in zip(formulas, answer, strict=True):
            assert np.array_equal(robustness(formula, signals, period), expected), formula


@pytest.mark.parametrize("period", [0.1])
def test_tulip_finds_the_gr1_specifications_realizable_or_not(period: float) -> None:
    cases = {
        (("G F r",), ("G (r -> F[0,0.3] g)", "G F !g")): True,
        ((), ("G (r -> F[0,0.3] g)", "G (g -> Y !r)")): False,
        ((), ("G (g <-> X r)",)): False,
        ((), ("G (g <-> Y r)",)): True,
        ((), ("G (g <-> O r)", "G (X g | !r S !g)")): True,
        (("G (r -> F !r)",), ("G F (g & !r)", "G (r -> !g)")): True,
        ((), ("G F (g & !r)", "G (r -> !g)")): False,
        ((), ("G (r -> G[0,0.2] g)", "G (g -> F[0,0.2] !g)")): False,
        (("G (r -> Y (!r & Y (!r & Y !r)))",), ("G (r -> G[0,0.2] g)", "G F !g")): True,
        (("F r",), ("F (r & g)", "G (g -> r)")): True,
    }
    texts = [
        tulip(Specification(tuple(map(parse, env)), tuple(map(parse, sys)), ("r",), ("g",)), period)
        for env, sys in cases
    ]
    assert asked("tulip", "tulip_realizable.py", texts) == list(cases.values())
