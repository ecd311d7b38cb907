"""Formulas and machines that go to Spot and come from it, by Spot's own parser, automata and synthesis."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from dubins_traffic.logic.parse import parse
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.specifications import exports
from dubins_traffic.specifications.exports import Specification
from dubins_traffic.specifications.task import task
from dubins_traffic.synthesis.foreign.hoa import read_hoa
from tests.tools import Solvers, solvers

pytestmark = pytest.mark.tools

SCRIPT = Path(__file__).with_name("spot_formulas.py")


@pytest.fixture(scope="module")
def tools() -> Iterator[Solvers]:
    with solvers() as found:
        yield found


def asked(tools: Solvers, **request: Any) -> Any:
    (answer,) = tools.ask("spot", SCRIPT, request)
    return answer


@pytest.mark.parametrize("name", ["demo", "town", "suburb"])
def test_spot_reads_the_task_of_a_shipped_configuration(tools: Solvers, name: str) -> None:
    instance = draw(load_config(name), 0, 0)
    text = exports.spot(task(instance.problem, instance.names), instance.problem.period)
    assert asked(tools, read=text) is True
    assert "F[0:46] F[0:254]" in text or not instance.problem.rules


@pytest.mark.parametrize("op", ["<>", "[]"])
@pytest.mark.parametrize(("low", "high"), [(0, 3), (0, 4), (0, 5), (0, 13), (2, 7), (4, 6), (5, 12), (9, 9)])
def test_parts_of_long_bounds_mean_what_next_says(
    tools: Solvers, monkeypatch: pytest.MonkeyPatch, op: str, low: int, high: int
) -> None:
    """With parts of 4 ticks: Spot's automata of hundreds of ticks take long."""
    monkeypatch.setattr(exports, "_SPOT_COUNTS", 4.0)
    text = exports.spot(Specification((), (parse(f"{op}[{low},{high}] p"),), (), ("p",)), 1.0)
    assert max(map(int, re.findall(r"\d+", text))) <= 4
    junction, meant = ("|" if op == "<>" else "&"), "p"
    for _ in range(high - low):
        meant = f"p {junction} X({meant})"
    assert asked(tools, same=[text, "X(" * low + meant + ")" * low]) is True
    assert asked(tools, same=[text, "X(" * (low + 1) + meant + ")" * (low + 1)]) is False


@pytest.mark.parametrize(("high", "parts"), [(254, [254]), (255, [1, 254]), (509, [1, 254, 254])])
def test_spot_reads_parts_and_no_longer_bound(tools: Solvers, high: int, parts: list[int]) -> None:
    text = exports.spot(Specification((), (parse(f"<>[0,{high}] p"),), (), ("p",)), 1.0)
    assert text == " ".join(f"F[0:{part}]" for part in parts) + " p"
    assert asked(tools, read=text) is True
    whole = asked(tools, read=f"F[0:{high}] p")
    assert whole is True if high <= 254 else "maximum supported repetition (254)" in whole


def test_a_machine_that_spot_has_made_is_read(tools: Solvers) -> None:
    machine = read_hoa(asked(tools, solve=["G (free <-> X go) & G (stay <-> !go)", ["go", "stay"]]))
    random, state, before = Random(1), machine.begin(), None
    for _ in range(100):
        free = random.random() < 0.5
        step = machine.step(state, {"free": free})
        assert step is not None
        state, told = step
        assert before in (None, told["go"])
        assert told["stay"] is not told["go"]
        before = free
