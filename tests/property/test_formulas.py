"""Formulas survive being written and read; rewriting keeps what they mean."""

from __future__ import annotations

from random import Random

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.logic.formula import (
    FALSE,
    PAST,
    TRUE,
    Formula,
    FormulaError,
    Op,
    conj,
    disj,
    interval,
    make,
    prop,
    subformulas,
    to_ascii,
    to_spin,
)
from dubins_traffic.logic.parse import parse
from dubins_traffic.logic.rewrite import (
    in_ticks,
    mapped,
    nnf,
    renamed,
    simplify,
    until_and_release_only,
    without_past,
    written_out,
)
from tests.formulas import drawn, holds, words

_UNARY = (Op.NOT, Op.X, Op.F, Op.G, Op.Y, Op.Z, Op.O, Op.H)
_BINARY = (Op.IMPLIES, Op.IFF, Op.U, Op.R, Op.W, Op.M, Op.S, Op.T)
_BOUNDED = (Op.F, Op.G, Op.U, Op.R)

_atoms = st.one_of(
    st.sampled_from((TRUE, FALSE)),
    st.from_regex(r"[a-z_][a-zA-Z0-9_]{0,6}", fullmatch=True)
    .filter(lambda name: name not in ("true", "false"))
    .map(prop),
)
_bounds = st.one_of(
    st.none(),
    st.tuples(st.floats(0, 1e9), st.floats(0, 1e9)).map(lambda pair: interval((min(pair), max(pair)))),
)


def _grown(parts: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
    return st.one_of(
        st.builds(lambda op, part: make(op, (part,)), st.sampled_from(_UNARY), parts),
        st.builds(lambda op, one, two: make(op, (one, two)), st.sampled_from(_BINARY), parts, parts),
        st.builds(
            lambda op, one, two, bounds: make(op, (one,) if op in (Op.F, Op.G) else (one, two), bounds=bounds),
            st.sampled_from(_BOUNDED),
            parts,
            parts,
            _bounds,
        ),
        st.builds(lambda join, items: join(*items), st.sampled_from((conj, disj)), st.lists(parts, max_size=4)),
    )


formulas = st.recursive(_atoms, _grown, max_leaves=25)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(formulas)
def test_parse_after_print_is_identity(formula: Formula) -> None:
    assert parse(to_spin(formula)) is formula
    assert parse(to_ascii(formula)) is formula


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.text(alphabet="ab()[]<>!&|-> UXGFVRWMYHOST,.019s\n~=\\/", max_size=40))
def test_any_text_is_a_formula_or_a_formula_error_with_a_place(text: str) -> None:
    place = _place_of_error(text)
    if place is None:
        formula = parse(text)
        assert parse(to_ascii(formula)) is formula
    else:
        lines = text.split("\n")
        assert 1 <= place[0] <= len(lines)
        assert 1 <= place[1] <= len(lines[place[0] - 1]) + 1


def _place_of_error(text: str) -> tuple[int, int] | None:
    try:
        parse(text)
    except FormulaError as error:
        return error.line or 0, error.column or 0
    return None


def _negations(formula: Formula) -> list[Formula]:
    return [part for part in subformulas(formula) if part.op is Op.NOT]


@settings(max_examples=250, deadline=None, derandomize=True)
@given(st.integers(0, 10**6), st.booleans(), st.booleans())
def test_rewriting_keeps_the_meaning(seed: int, past: bool, bounds: bool) -> None:
    names = ("a", "b")
    random = Random(seed)
    raw = drawn(random, 4, names, past=past, bounds=bounds)
    formula = mapped(raw, lambda part: random.choice((part, part, part, TRUE, FALSE)) if not part.args else part)
    plain = nnf(formula)
    assert all(part.args[0].op is Op.PROP for part in _negations(plain))
    assert not {Op.IMPLIES, Op.IFF} & {part.op for part in subformulas(plain)}
    simple = simplify(formula)
    assert simple.size <= formula.size
    counted = in_ticks(formula, 1.0)
    for before, around in ((0, 2), (2, 2), (1, 3)):
        found = words(4, before + around)
        value = holds(formula, found[:, :before], found[:, before:], names)
        for other in (plain, simple, counted, written_out(counted), until_and_release_only(formula)):
            assert np.array_equal(value, holds(other, found[:, :before], found[:, before:], names)), other


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.integers(0, 10**6))
def test_memory_stands_for_past_operators(seed: int) -> None:
    names = ("a", "b")
    formula = drawn(Random(seed), 4, names, past=True, bounds=False)
    (changed,), memories = without_past([formula])
    assert not PAST & {part.op for part in subformulas(changed)}
    known: dict[str, Formula] = {}
    for memory in memories:
        before = make(Op.Z if memory.first else Op.Y, (memory.meaning,))
        known[memory.name] = memory.meaning if memory.meaning.op in (Op.Y, Op.Z) else before
    found = words(4, 4)
    value = holds(formula, found[:, :2], found[:, 2:], names)
    for checked in (
        changed,
        *(memory.initially for memory in memories),
        *(memory.step for memory in memories),
    ):
        back = mapped(checked, lambda part: known.get(part.name, part))
        expected = value if checked is changed else np.ones_like(value)
        assert np.array_equal(expected, holds(back, found[:, :2], found[:, 2:], names)), checked


def test_renaming() -> None:
    assert renamed(parse("[] (a -> <> b)"), {"a": "x"}) is parse("[] (x -> <> b)")
