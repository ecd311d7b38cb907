"""Quantitative robustness on signals that can be checked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.logic.parse import parse
from dubins_traffic.logic.robustness import robustness

A = np.array([3.0, 1.0, -2.0, 4.0])
B = np.array([-1.0, -1.0, 5.0, 0.5])
INF = np.inf


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[] a", [-2, -2, -2, 4]),
        ("<> a", [4, 4, 4, 4]),
        ("G[0,1] a", [1, -2, -2, 4]),
        ("F[1,2] a", [1, 4, 4, -INF]),
        ("a U b", [1, 1, 5, 0.5]),
        ("a U[0,1] b", [-1, 1, 5, 0.5]),
        ("a U[2,3] b", [1, -2, -INF, -INF]),
        ("X a", [1, -2, 4, -INF]),
        ("Y a", [-INF, 3, 1, -2]),
        ("Z a", [INF, 3, 1, -2]),
        ("O a", [3, 3, 3, 4]),
        ("H a", [3, 1, -2, -2]),
        ("a S b", [-1, -1, 5, 4]),
        ("a && !b", [1, 1, -5, -0.5]),
        ("a -> b", [-1, -1, 5, 0.5]),
        ("a <-> b", [-1, -1, -2, 0.5]),
        ("true", [INF, INF, INF, INF]),
        ("[] (b -> F[0,2] a)", [3, 4, 4, 4]),
    ],
)
def test_values(text: str, expected: list[float]) -> None:
    signals = {"a": A, "b": B}
    assert robustness(parse(text), signals, 1.0).tolist() == expected


def test_bounds_are_rounded_up_to_ticks_and_batches_are_judged_at_once() -> None:
    signal = np.random.default_rng(2).normal(size=(5, 3, 400))
    found = robustness(parse("G (a -> F[0,10] b)"), {"a": -signal, "b": signal}, 1 / 30)
    assert found.shape == signal.shape
    one = robustness(parse("G (a -> F[0,9.97] b)"), {"a": -signal[4, 2], "b": signal[4, 2]}, 1 / 30)
    assert np.array_equal(found[4, 2], one)
    window = robustness(parse("F[0.1,0.5] a"), {"a": signal}, 0.1)
    slow = [signal[..., t + 1 : t + 6].max(axis=-1) for t in range(395)]
    assert np.array_equal(window[..., :395], np.stack(slow, axis=-1))


def test_bad_signals_are_refused() -> None:
    with pytest.raises(FormulaError, match="no signal for a proposition: got 'b'"):
        robustness(parse("a U b"), {"a": A}, 1.0)
    with pytest.raises(FormulaError, match="different shapes"):
        robustness(parse("a U b"), {"a": A, "b": B[:2]}, 1.0)
