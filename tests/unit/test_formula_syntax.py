"""The parser and the printer of formulas."""

from __future__ import annotations

import pickle
import sys

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.logic.formula import (
    FALSE,
    TRUE,
    Formula,
    FormulaError,
    always,
    conj,
    disj,
    eventually,
    iff,
    implies,
    negation,
    next_,
    once,
    prop,
    propositions,
    release,
    since,
    to_ascii,
    to_spin,
    until,
    weak_until,
    yesterday,
)
from dubins_traffic.logic.parse import parse

a, b, c, d = map(prop, "abcd")


@pytest.mark.parametrize(
    ("text", "formula"),
    [
        ("[]<> ego_t_2_0", always(eventually(prop("ego_t_2_0")))),
        (
            "([]<> ego_t_2_0) && ([]<>ego_t_1_1)",
            always(eventually(prop("ego_t_2_0"))) & always(eventually(prop("ego_t_1_1"))),
        ),
        ("a && b & c /\\ d", conj(a, b, c, d)),
        ("a || b | c \\/ d", disj(a, b, c, d)),
        ("a && b || c && d", disj(conj(a, b), conj(c, d))),
        ("a -> b -> c", implies(a, implies(b, c))),
        ("a <-> b <=> c", iff(iff(a, b), c)),
        ("a => b || c", implies(a, disj(b, c))),
        ("!a U b", until(negation(a), b)),
        ("a U b U c", until(a, until(b, c))),
        ("a U b && c", conj(until(a, b), c)),
        ("a V b", release(a, b)),
        ("a R[1,2] b", release(a, b, (1, 2))),
        ("a W b", weak_until(a, b)),
        ("~ X Y a S O b", since(negation(next_(yesterday(a))), once(b))),
        (
            "[](left_r -> <>[0, 10 s] !left_r)",
            always(implies(prop("left_r"), eventually(negation(prop("left_r")), (0, 10)))),
        ),
        ("F[0,.5] G[1e-1,2.] a", eventually(always(a, (0.1, 2)), (0, 0.5))),
        ("true && 1 || false || 0", disj(conj(TRUE, TRUE), FALSE, FALSE)),
        ("Ga", prop("Ga")),
        ("\n(\ta\r\n)\n", a),
        ("(" * 50_000 + "a" + ")" * 50_000, a),
        ("a <-> b -> c || d && a U X b", iff(a, implies(b, disj(c, conj(d, until(a, next_(b))))))),
        ("a U X b && d || c -> b <-> a", iff(implies(disj(conj(until(a, next_(b)), d), c), b), a)),
    ],
)
def test_reads(text: str, formula: Formula) -> None:
    assert parse(text) is formula


MALFORMED = [
    ("", 1, 1),
    ("   ", 1, 1),
    ("\n\n", 1, 1),
    ("(", 1, 2),
    (")", 1, 1),
    ("()", 1, 2),
    ("(a", 1, 3),
    ("a)", 1, 2),
    ("((a)", 1, 5),
    ("(a))", 1, 4),
    ("a b", 1, 3),
    ("a !b", 1, 3),
    ("a (b)", 1, 3),
    ("true false", 1, 6),
    ("&& a", 1, 1),
    ("a &&", 1, 5),
    ("a && && b", 1, 6),
    ("a &&& b", 1, 5),
    ("a ||| b", 1, 5),
    ("a -> ", 1, 5),
    ("-> a", 1, 1),
    ("a - b", 1, 3),
    ("a <- b", 1, 3),
    ("a <-> <-> b", 1, 7),
    ("a = b", 1, 3),
    ("a == b", 1, 3),
    ("a U", 1, 4),
    ("U a", 1, 1),
    ("a U U b", 1, 5),
    ("a V", 1, 4),
    ("G", 1, 2),
    ("[]", 1, 3),
    ("<>", 1, 3),
    ("X && a", 1, 3),
    ("[ ] a", 1, 1),
    ("< > a", 1, 1),
    ("!", 1, 2),
    ("a!", 1, 2),
    ("1a", 1, 1),
    ("a 1", 1, 3),
    ("2", 1, 1),
    ("0.5", 1, 1),
    ("a.b", 1, 2),
    ("a $ b", 1, 3),
    ('"a"', 1, 1),
    ("a, b", 1, 2),
    ("F[ a", 1, 4),
    ("F[0 a", 1, 5),
    ("F[0,] a", 1, 5),
    ("F[0,1 a", 1, 7),
    ("F[0 1] a", 1, 5),
    ("F[3,1] a", 1, 2),
    ("F[-1,1] a", 1, 3),
    ("F[0,1e999] a", 1, 2),
    ("F[a,b] c", 1, 3),
    ("F[0,1]", 1, 7),
    ("X[0,1] a", 1, 2),
    ("a W[0,1] b", 1, 4),
    ("a S[0,1] b", 1, 4),
    ("a &&\n  (b ||\n   -> c)", 3, 4),
    ("a\n&& é", 2, 4),
    ("!" * 300 + "a", 1, 201),
    ("a -> " * 300 + "a", 1, 1003),
    ("a U (" * 110 + "a" + ")" * 110, 1, 53),
    ("(" * 100_000, 1, 100_001),
    ("a" * 200_001, 1, 1),
    (" && ".join(["a"] * 30_000), 1, 3),
]


@pytest.mark.parametrize(("text", "line", "column"), MALFORMED, ids=lambda value: repr(value)[:20])
def test_refuses_with_line_and_column(text: str, line: int, column: int) -> None:
    with pytest.raises(FormulaError) as caught:
        parse(text, file="task.ltl")
    error = caught.value
    assert (error.line, error.column) == (line, column)
    assert f"line {line}, column {column}: " in str(error)
    assert str(error).startswith("task.ltl: ")
    assert error.expected


def test_errors_keep_their_place_when_they_are_placed_in_a_document() -> None:
    with pytest.raises(InputError) as caught:
        parse("a &&")
    placed = caught.value.within(file="x.json", field="formulas.mine")
    assert isinstance(placed, FormulaError)
    assert (placed.line, placed.column) == (1, 5)
    assert str(placed).startswith("x.json: formulas.mine: line 1, column 5: ends too early; expected a proposition")


@pytest.mark.parametrize(
    ("text", "spin", "ascii_"),
    [
        ("((a && b)) || (c)", "(a && b) || c", "a & b | c"),
        ("[](a -> (<> b))", "[] (a -> <> b)", "G (a -> F b)"),
        ("(a U b) && (c V d)", "a U b && c V d", "a U b & c R d"),
        ("(a -> b) -> c", "(a -> b) -> c", "(a -> b) -> c"),
        ("a -> (b -> c)", "a -> (b -> c)", "a -> b -> c"),
        ("F[0,10] !a", "<>[0,10] !a", "F[0,10] !a"),
        ("F[0,0.1] (a U b)", "<>[0,0.1] (a U b)", "F[0,0.1] (a U b)"),
        ("(a && b) && (c && d)", "a && b && c && d", "a & b & c & d"),
    ],
)
def test_prints_with_few_parentheses(text: str, spin: str, ascii_: str) -> None:
    formula = parse(text)
    assert to_spin(formula) == spin
    assert to_ascii(formula) == ascii_


def test_formulas_are_shared_frozen_and_can_be_pickled() -> None:
    formula = parse("[] (a -> <>[0,10] b)")
    assert formula is always(implies(a, eventually(b, (0.0, 10.0))))
    assert pickle.loads(pickle.dumps(formula)) is formula
    with pytest.raises(AttributeError):
        formula.name = "x"
    assert propositions(formula) == ("a", "b")
    assert repr(formula) == "<Formula G (a -> F[0,10] b)>"


@pytest.mark.parametrize("name", ["", "1a", "a b", "G", "V", "true", "a-b", "a\n"])
def test_names_of_propositions(name: str) -> None:
    with pytest.raises(FormulaError):
        prop(name)


def test_depth_is_limited_when_formulas_are_built() -> None:
    formula = a
    for _ in range(99):
        formula = next_(formula)
    with pytest.raises(FormulaError, match="nested too deeply"):
        next_(formula)


def test_reading_formulas_does_not_load_the_compiler() -> None:
    import subprocess

    code = (
        "import sys; from dubins_traffic.logic import parse, robustness, monitor;"
        "import dubins_traffic.specifications.exports;"
        "monitor.Monitors({'f': parse.parse('[] a')}, ['a'], 0.1); sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
