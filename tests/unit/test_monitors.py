"""Monitors: verdicts at the right tick, clocks, limits and their reasons."""

from __future__ import annotations

import time

import numpy as np
import pytest

from dubins_traffic.logic.automaton import FALSE, PRESUMABLY_FALSE, PRESUMABLY_TRUE, TRUE
from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.logic.monitor import Monitors, compiled, parts
from dubins_traffic.logic.parse import parse


def history(text: str, names: str, rows: list[str], period: float = 1.0) -> str:
    """Return the verdicts after each frame as letters: F, f, t, T; a row names what holds in it."""
    monitors = Monitors({"f": parse(text)}, tuple(names), period)
    monitors.reset(1)
    out = ""
    for row in rows:
        out += "FftT"[int(monitors.update(np.array([[name in row for name in names]]))[0, 0])]
    return out


@pytest.mark.parametrize(
    ("text", "rows", "verdicts"),
    [
        ("[] a", ["a", "a", "", "a"], "ttFF"),
        ("<> a", ["", "", "a", ""], "ffTT"),
        ("[]<> a", ["", "a", "", "a"], "ftft"),
        ("<>[] a", ["", "a", "", "a"], "ftft"),
        ("a U b", ["a", "a", "b", ""], "ffTT"),
        ("a U b", ["a", "", "b"], "fFF"),
        ("a W b", ["a", "a", "", ""], "ttFF"),
        ("X a", ["", "a"], "fT"),
        ("[] (a -> X b)", ["a", "b", "ab", ""], "ftfF"),
        ("[] (a -> Y b)", ["b", "a", "a"], "ttF"),
        ("[] (a -> Y b)", ["a"], "F"),
        ("[] (a -> !b S c)", ["c", "a", "b", "a"], "tttF"),
        ("[] (b -> O a)", ["", "a", "b"], "tTT"),
        ("H a -> <> b", ["a", "b"], "fT"),
        ("[] (a -> X Y a)", [""], "T"),
        ("(<> a) && [] !a", [""], "F"),
        ("F[0,2] a", ["", "", ""], "ffF"),
        ("F[1,2] a", ["a", "", "a"], "ffT"),
        ("G[1,2] a", ["", "a", "a"], "ttT"),
        ("a U[1,2] b", ["ab", "ab"], "fT"),
        ("true", [""], "T"),
        ("a -> a", [""], "T"),
    ],
)
def test_verdicts(text: str, rows: list[str], verdicts: str) -> None:
    assert history(text, "abc", rows) == verdicts


def test_contradicting_parts_in_one_piece_are_false_at_once() -> None:
    formula = {"f": parse("(<> a) && [] !a")}
    assert Monitors(formula, ("a",), 1.0, split=False).verdicts.shape == (0, 1)
    monitors = Monitors(formula, ("a",), 1.0, split=False)
    monitors.reset(1)
    assert monitors.verdicts[0, 0] == FALSE
    split = Monitors(formula, ("a",), 1.0, split=True)
    split.reset(1)
    assert split.late == {"f"}
    assert split.verdicts[0, 0] == PRESUMABLY_FALSE or split.verdicts[0, 0] == PRESUMABLY_TRUE


def test_parts_that_share_propositions_are_put_together_where_that_is_cheap() -> None:
    assert history("[] p && <> !p", "p", []) == ""
    for text in ("[] p && <> !p", "[] (a -> <> p) && <> a && [] !p", "([]<> p) && <>[] !p && [] q"):
        monitors = Monitors({"f": parse(text)}, ("a", "p", "q"), 1.0)
        monitors.reset(1)
        assert (monitors.verdicts[0, 0], monitors.late) == (FALSE, frozenset()), text


def test_what_is_too_large_to_be_put_together_is_said_to_be_late() -> None:
    large = " && ".join(f"[] (a -> <> b{i})" for i in range(11))
    texts = {"large": large, "delayed": "[] (a -> <>[5,10] c)", "small": "[] a && <> c"}
    names = ("a", "c", *(f"b{i}" for i in range(11)))
    begun = time.process_time()
    monitors = Monitors({name: parse(text) for name, text in texts.items()}, names, 1 / 30)
    assert monitors.late == {"large", "delayed"}
    assert time.process_time() - begun < 30
    monitors.reset(1)
    monitors.update(np.ones((1, len(names))))
    assert monitors.verdicts[0].tolist() == [PRESUMABLY_TRUE, PRESUMABLY_FALSE, PRESUMABLY_TRUE]


@pytest.mark.parametrize(("rate", "ticks"), [(30.0, 300), (10.0, 100), (7.0, 70)])
def test_the_ten_seconds_of_rule_2_end_at_the_right_tick(rate: float, ticks: int) -> None:
    assert history("[] (l -> <>[0,10] !l)", "l", [""] + ["l"] * ticks + [""], 1 / rate) == "t" + "f" * ticks + "t"
    assert history("[] (l -> <>[0,10] !l)", "l", [""] + ["l"] * (ticks + 2), 1 / rate) == "t" + "f" * ticks + "FF"


def test_a_clock_follows_the_oldest_request_and_starts_anew() -> None:
    rows = ["r", "", "r", "", "", "g", "r", "", "", "", "", "", "g"]
    assert history("G (r -> F[0,5] g)", "rg", rows) == "ffffftfffffFF"


def test_a_clock_follows_the_latest_request_for_what_must_last() -> None:
    rows = ["rg", "g", "g", "rg", "g", "g", "g", "g", "g", "", "rg", ""]
    assert history("G (r -> G[0,5] g)", "rg", rows) == "tttttttttttF"


def test_long_bounds_need_no_large_tables() -> None:
    found = compiled(parse("G (a -> b U[0,3600] c)"), 1 / 100)
    assert found.target.shape[0] <= 4
    assert found.clocks.tolist() == [360_000]


def test_bounds_that_begin_later_wait_in_a_delay_line() -> None:
    rows = [""] * 400
    rows[3] = rows[10] = rows[40] = "r"
    rows[160] = "g"
    found = history("G (r -> F[5,10] g)", "rg", rows, 1 / 30)
    assert found == "ttt" + "f" * (40 + 300 - 3) + "F" * 60
    rows[190] = "g"
    assert history("G (r -> F[5,10] g)", "rg", rows, 1 / 30) == "ttt" + "f" * (190 - 3) + "t" * 210


def test_parts_are_split_and_share_tables() -> None:
    text = " && ".join(f"[] (enter_{v} -> Y stopped_{v} && Y !ahead_{v})" for v in range(40))
    found = parts(parse(text))
    assert len(found) == 80
    names = [f"{name}_{v}" for v in range(40) for name in ("enter", "stopped", "ahead")]
    assert Monitors({"rule 3": parse(text)}, names, 0.1, split=True).tables == 80
    monitors = Monitors({"rule 3": parse(text)}, names, 0.1)
    assert (monitors.tables, monitors.late) == (40, frozenset())
    monitors.reset(2)
    frame = np.zeros((2, len(names)))
    assert monitors.update(frame).tolist() == [[PRESUMABLY_TRUE]] * 2
    frame[1, names.index("stopped_7")] = 1
    assert monitors.update(frame).tolist() == [[PRESUMABLY_TRUE]] * 2
    frame[:, names.index("enter_7")] = 1
    assert monitors.update(frame).tolist() == [[FALSE], [PRESUMABLY_TRUE]]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (" || ".join(f"F (p{i} && X p{i})" for i in range(13)), "too many propositions in one part"),
        (" || ".join(f"F p{i}" for i in range(12)), "too many combinations|too large"),
        ("Y F a", "a past operator ranges over a future one"),
        ("G (a -> F[0,10] (b & F[0,10] c))", "can be asked for again while it is pending|too large"),
        (" && ".join(f"[] p{i}" for i in range(600)), "too many parts"),
    ],
)
def test_what_is_too_large_is_refused_with_a_reason(text: str, reason: str) -> None:
    formula = parse(text)
    names = tuple({f"p{i}" for i in range(13)} | {"a", "b", "c"})
    start = time.process_time()
    with pytest.raises(FormulaError, match=reason) as caught:
        Monitors({"mine": formula}, names, 1 / 30)
    assert time.process_time() - start < 30
    assert str(caught.value).startswith("mine: ")
    assert caught.value.expected


def test_unknown_propositions_and_shapes_are_refused() -> None:
    with pytest.raises(FormulaError, match="mine: unknown proposition: got 'b'"):
        Monitors({"mine": parse("a U b")}, ("a",), 1.0)
    with pytest.raises(FormulaError, match="not a period"):
        Monitors({}, (), 0.0)
    monitors = Monitors({"mine": parse("[] a")}, ("a",), 1.0)
    monitors.reset(3)
    with pytest.raises(ValueError, match="shape"):
        monitors.update(np.zeros((3, 2)))


def test_verdicts_before_the_first_frame() -> None:
    monitors = Monitors({"t": parse("a | !a"), "f": parse("a & !a"), "g": parse("[] a")}, ("a",), 1.0)
    monitors.reset(1)
    assert monitors.verdicts.tolist() == [[TRUE, FALSE, PRESUMABLY_TRUE]]
