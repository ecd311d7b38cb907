"""Exports: what each format contains, that its grammar is kept, and what is refused."""

from __future__ import annotations

from random import Random

import pytest

from dubins_traffic.logic.formula import (
    ASCII,
    SPIN,
    Brackets,
    Formula,
    FormulaError,
    Style,
    conj,
    implies,
    written,
    written_implication,
    written_together,
)
from dubins_traffic.logic.parse import parse
from dubins_traffic.specifications.exports import (
    FORMATS,
    Specification,
    latex,
    slugs,
    spin,
    spot,
    stl,
    tlsf,
    tulip,
)
from tests.formulas import drawn
from tests.grammars import TLSF, slugs_sections, tlsf_sections

TASK = Specification(
    assumptions=tuple(map(parse, ("[]<> free_0", "[] (stands -> <>[0,5] !stands)", "[] (ahead -> <> !ahead)"))),
    guarantees=tuple(
        map(
            parse,
            (
                "[] !hit && []<> at_0 && []<> at_1",
                "[] (left -> over) && [] (left -> <>[0,1] !left)",
                "[] (enter -> Y (stopped && !ahead))",
                "[] (enter -> (!ahead S clear))",
                "[] (brake -> [][0,0.5] brake)",
                "[] (enter -> X brake)",
                "!left",
            ),
        )
    ),
    inputs=("free_0", "stands", "hit", "over", "stopped", "ahead", "clear"),
    outputs=("at_0", "at_1", "left", "enter", "brake"),
)
PERIOD = 0.1


def test_spin_without_past_and_bounds() -> None:
    plain = Specification((parse("[]<> f"),), (parse("[] (e -> (a W b))"), parse("a M b")), ("f",), ("e", "a", "b"))
    assert spin(plain, PERIOD) == "[] <> f -> ([] (e -> b V (a || b)) && b U (a && b))"


def test_spin_writes_memory_and_short_bounds_with_next() -> None:
    task = Specification((), (parse("[] (e -> Y s)"), parse("[] (e -> <>[0,0.2] s)")), ("s",), ("e",))
    assert spin(task, PERIOD) == (
        "(!past_1 && [] (X past_1 <-> s)) -> ([] (e -> past_1) && [] (e -> (s || X (s || X s))))"
    )
    with pytest.raises(FormulaError, match="too long to be written out with next"):
        spin(TASK, 0.01)


def test_spot_counts_ticks() -> None:
    task = Specification((), (parse("[] (l -> <>[0,10] !l)"), parse("a U[1,2] b")), (), ("l", "a", "b"))
    assert spot(task, 1 / 30) == "G (l -> F[0:46] F[0:254] !l) & G[0:29] a & F[30:30] (a U b & F[0:30] b)"


def test_stl_has_signals_and_seconds() -> None:
    task = Specification((parse("[]<> f"),), (parse("[] (l -> <>[0,10] !l)"), parse("a T b")), ("f",), ("l", "a", "b"))
    assert stl(task, 1 / 30) == (
        "(always (eventually (f > 0))) -> ((always ((l > 0) -> (eventually[0:10] (not (l > 0))))) and "
        "(not ((not (a > 0)) since (not (b > 0)))))"
    )


def test_tlsf_keeps_its_grammar() -> None:
    text = tlsf(TASK, PERIOD)
    sections = tlsf_sections(text)
    assert sections["inputs"] == [*TASK.inputs, "past_1", "past_2"]
    assert sections["outputs"] == [*TASK.outputs]
    assert [len(sections[name]) for name in TLSF[2:]] == [2, 1, 2, 3, 3, 3], text
    assert any("G (left -> (F[0:10] (!left)))" in part for part in sections["guarantee"])
    assert "enter -> (X brake)" in sections["assert"]


def test_slugs_keeps_its_grammar() -> None:
    sections = slugs_sections(slugs(TASK, PERIOD))
    assert all(sections[name] for name in sections)
    assert sections["ENV_LIVENESS"] == ["free_0", "!owed_1"]
    assert sections["SYS_LIVENESS"] == ["at_0", "at_1"]
    assert "past_1' <-> (stopped & (!ahead))" in sections["ENV_TRANS"]
    assert "enter -> brake'" in sections["SYS_TRANS"]
    assert "!left" in sections["SYS_INIT"]


def test_tulip_is_a_python_file() -> None:
    text = tulip(TASK, PERIOD)
    made: dict[str, object] = {}
    source = text.replace("from tulip.spec.form import GRSpec", "GRSpec = dict")
    exec(compile(source, "specification.py", "exec"), made)
    found = made["specification"]
    assert isinstance(found, dict)
    assert found["env_vars"] | found["sys_vars"] == {
        **dict.fromkeys((*TASK.inputs, *TASK.outputs, "past_1", "past_2", "owed_1"), "boolean"),
        "ticks_1": (0, 50),
        "ticks_2": (0, 10),
        "left_1": (0, 5),
    }
    assert found["sys_prog"] == ["at_0", "at_1"]


def test_latex_escapes_names() -> None:
    text = latex(Specification((), (parse("[] (left_r -> <>[0,10] !left_r)"),), (), ("left_r",)), PERIOD)
    assert "\\Box (\\mathit{left\\_r} \\rightarrow \\Diamond_{[0,10]} \\neg \\mathit{left\\_r})" in text
    assert text.count("{") == text.count("}")
    assert "\\varphi_{\\mathrm{env}} &= \\top" in text


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_every_format_takes_a_task_without_assumptions(name: str) -> None:
    assert FORMATS[name](Specification((), (parse("[]<> a"),), (), ("a",)), PERIOD)


@pytest.mark.parametrize(
    ("assumption", "guarantee", "reason"),
    [
        ("true", "a U b", "not of a form that GR\\(1\\) knows"),
        ("true", "F G a", "not of a form that GR\\(1\\) knows"),
        ("true", "G X X a", "not of a form that GR\\(1\\) knows"),
        ("true", "G (a -> F[1,2] b)", "not of a form that GR\\(1\\) knows"),
        ("G X a", "true", "an assumption restricts what the system chooses next"),
        ("a", "true", "an assumption restricts what the system chooses first"),
        ("true", "Y F a", "a past operator ranges over a future one"),
    ],
)
def test_what_gr1_does_not_know_is_refused(assumption: str, guarantee: str, reason: str) -> None:
    task = Specification((parse(assumption),), (parse(guarantee),), ("b",), ("a",))
    for export in (slugs, tulip):
        with pytest.raises(FormulaError, match=reason):
            export(task, PERIOD)


def test_sides_must_be_clear() -> None:
    with pytest.raises(FormulaError, match="neither input nor output: got 'a'"):
        Specification((), (parse("[] a"),), ("b",), ())
    with pytest.raises(FormulaError, match="both input and output: got 'a'"):
        Specification((), (), ("a",), ("a",))


@pytest.mark.parametrize("style", [SPIN, ASCII, Style({}, Brackets.ALL)], ids=["spin", "ascii", "all brackets"])
def test_what_is_written_together_is_what_the_whole_formula_is(style: Style) -> None:
    random = Random(4)

    def side() -> tuple[Formula, ...]:
        return tuple(
            drawn(random, random.randint(0, 3), ("a", "b"), past=True, bounds=True) for _ in range(random.randint(0, 3))
        )

    for _ in range(200):
        left, right = side(), side()
        assert written_together(left, style) == written(conj(*left), style)
        whole = implies(conj(*left), conj(*right)) if left else conj(*right)
        assert written_implication(left, right, style) == written(whole, style)
