"""The task in the languages of other tools, as text.

All take a `Specification`: the assumptions about the environment imply the guarantees of the system. Past operators
become memory that the environment keeps (`rewrite.Memory`) where the tool has none: inputs whose first value and
every step the assumptions fix. Bounds become ticks of the given period except in STL and LaTeX.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from dubins_traffic.logic.formula import (
    FUTURE,
    PAST,
    SPIN,
    Bounds,
    Brackets,
    Formula,
    FormulaError,
    Op,
    Style,
    always,
    conj,
    implies,
    make,
    number,
    propositions,
    subformulas,
    ticks,
    written,
    written_implication,
    written_together,
)
from dubins_traffic.logic.rewrite import (
    MAX_NEXT,
    for_signals,
    in_ticks,
    mapped,
    until_and_release_only,
    without_past,
    written_out,
)
from dubins_traffic.specifications.gr1 import gr1, slugs_text, tulip_text


@dataclass(frozen=True)
class Specification:
    """Assumptions and guarantees over named propositions.

    Attributes
    ----------
    assumptions, guarantees : tuple of Formula
        Each a conjunction.
    inputs, outputs : tuple of str
        Who chooses which proposition: the environment the inputs, the system the outputs.

    Raises
    ------
    FormulaError
        If a proposition is neither input nor output, or both.
    """

    assumptions: tuple[Formula, ...]
    guarantees: tuple[Formula, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]

    def __post_init__(self) -> None:
        both = set(self.inputs) & set(self.outputs)
        if both:
            raise FormulaError("both input and output", value=min(both), expected="one of them")
        known = {*self.inputs, *self.outputs}
        for formula in (*self.assumptions, *self.guarantees):
            for name in propositions(formula):
                if name not in known:
                    raise FormulaError("neither input nor output", value=name, expected="one of them")

    @property
    def whole(self) -> Formula:
        """The assumptions imply the guarantees; the guarantees alone if nothing is assumed."""
        if not self.assumptions:
            return conj(*self.guarantees)
        return implies(conj(*self.assumptions), conj(*self.guarantees))


def _changed(spec: Specification, change: Callable[[Formula], Formula]) -> Specification:
    return Specification(
        tuple(map(change, spec.assumptions)), tuple(map(change, spec.guarantees)), spec.inputs, spec.outputs
    )


def _without_past(spec: Specification) -> Specification:
    """Return an equivalent specification in which the environment remembers."""
    changed, memories = without_past([*spec.assumptions, *spec.guarantees])
    count = len(spec.assumptions)
    kept = [part for memory in memories for part in (memory.initially, always(memory.step))]
    return Specification(
        (*kept, *changed[:count]),
        changed[count:],
        (*spec.inputs, *(memory.name for memory in memories)),
        spec.outputs,
    )


def _whole(spec: Specification, style: Style) -> str:
    """Return the text of `spec.whole`, which may be longer than a formula can be."""
    return written_implication(spec.assumptions, spec.guarantees, style)


def _check_longest(spec: Specification, period: float, most: int, why: str) -> None:
    """Refuse a specification with a bound of more than `most` ticks of `period` seconds."""
    sides = (spec.assumptions, spec.guarantees)
    bounds = [part.bounds for side in sides for one in side for part in subformulas(one)]
    longest = max((high for _, high in filter(None, bounds)), default=0.0)
    if ticks(longest, period) > most:
        raise FormulaError(
            f"a bound of {number(longest)} s is too long {why}",
            expected=f"a period of at least {longest / most:.4g} s, or a format that counts",
        )


def spin(spec: Specification, period: float) -> str:
    """Return one formula for SPIN.

    Past and bounded operators need next (``X``), for which SPIN must be built with ``-DNXT``.

    Raises
    ------
    FormulaError
        If a bound is too long to be written out; says which period would do.
    """
    _check_longest(spec, period, MAX_NEXT, "to be written out with next")
    plain = _changed(
        _without_past(spec), lambda formula: written_out(until_and_release_only(in_ticks(formula, period)))
    )
    return _whole(plain, SPIN)


def _colon(bounds: Bounds) -> str:
    return f"[{number(bounds[0])}:{number(bounds[1])}]"


_SPOT_COUNTS: Final = 254.0
"""The largest bound that Spot reads."""
_SPOT_PARTS: Final = 50
"""Of how many parts a long bound may be, within the levels that a formula may have."""
_SPOT: Final = Style({Op.AND: "&", Op.OR: "|", Op.TRUE: "1", Op.FALSE: "0"}, bounds=_colon)


def spot(spec: Specification, period: float) -> str:
    """Return one formula as Spot reads it; bounds in ticks, long ones in parts: ``F[0:46] F[0:254] p``.

    FormulaError if a bound is too long for that; says which period would do.
    """
    _check_longest(spec, period, _SPOT_PARTS * int(_SPOT_COUNTS), "for Spot")
    plain = _changed(_without_past(spec), lambda formula: in_ticks(formula, period))
    return _whole(_changed(plain, lambda formula: mapped(formula, _in_parts)), _SPOT)


def _in_parts(part: Formula) -> Formula:
    """Return F or G with bounds as F of F, or G of G, with bounds that Spot reads: these add up."""
    if part.bounds is None:
        return part
    low, high = part.bounds
    (inner,) = part.args
    while high > _SPOT_COUNTS:
        inner = make(part.op, (inner,), bounds=(min(low, _SPOT_COUNTS), _SPOT_COUNTS))
        low, high = max(low - _SPOT_COUNTS, 0.0), high - _SPOT_COUNTS
    return make(part.op, (inner,), bounds=(low, high))


def _positive(name: str) -> str:
    return f"({name} > 0)"


_STL: Final = Style(
    {
        Op.TRUE: "(1e300 > 0)",
        Op.FALSE: "(0 > 1e300)",
        Op.NOT: "not",
        Op.AND: "and",
        Op.OR: "or",
        Op.X: "s_next",
        Op.F: "eventually",
        Op.G: "always",
        Op.U: "until",
        Op.Y: "s_prev",
        Op.Z: "prev",
        Op.O: "once",
        Op.H: "historically",
        Op.S: "since",
    },
    Brackets.ALL,
    bounds=_colon,
    name=_positive,
    tight=False,
)


def stl(spec: Specification, period: float) -> str:
    """Return one formula as rtamt reads it: every proposition is a signal, positive where it holds; bounds in seconds.

    Bounds are rounded up to whole periods, since rtamt wants multiples of its sampling period.
    """

    def change(formula: Formula) -> Formula:
        return for_signals(_rounded(formula, period))

    return _whole(_changed(spec, change), _STL)


def _rounded(formula: Formula, period: float) -> Formula:
    def change(part: Formula) -> Formula:
        if part.bounds is None:
            return part
        low, high = (ticks(bound, period) * period for bound in part.bounds)
        return make(part.op, part.args, bounds=(round(low, 9), round(high, 9)))

    return mapped(formula, change)


_TLSF: Final = Style({}, Brackets.ALL, bounds=_colon)
_TEMPORAL: Final = FUTURE | PAST


def tlsf(spec: Specification, period: float, title: str = "Traffic network of Dubins cars") -> str:
    """Return a document in TLSF (full format, strict Mealy semantics; bounds in ticks).

    Strict: the system must keep its steps for as long as the environment has kept its own, so it can't win by a breach
    that leaves the environment without a step.
    """
    plain = _changed(_without_past(spec), lambda formula: until_and_release_only(in_ticks(formula, period)))
    assumed, guaranteed = _by_form(plain.assumptions), _by_form(plain.guarantees)
    sections: dict[str, Sequence[str]] = {"INPUTS": plain.inputs, "OUTPUTS": plain.outputs}
    for place, names in enumerate((("INITIALLY", "PRESET"), ("REQUIRE", "ASSERT"), ("ASSUME", "GUARANTEE"))):
        for name, side in zip(names, (assumed, guaranteed), strict=True):
            sections[name] = [written(formula, _TLSF) for formula in side[place]]
    lines = ["INFO {", f'  TITLE: "{_quoted(title)}"', '  DESCRIPTION: "Rules of the road"']
    lines += ["  SEMANTICS: Mealy,Strict", "  TARGET: Mealy", "}", "", "MAIN {"]
    for name, items in sections.items():
        if items or name in ("INPUTS", "OUTPUTS"):
            lines += [f"  {name} {{", *(f"    {item};" for item in items), "  }"]
    return "\n".join([*lines, "}"]) + "\n"


def _by_form(side: Sequence[Formula]) -> tuple[list[Formula], list[Formula], list[Formula]]:
    """Return what holds at first, what holds of every step (without its `always`), and all else."""
    first: list[Formula] = []
    steps: list[Formula] = []
    others: list[Formula] = []
    for formula in side:
        within = {part.op for part in subformulas(formula.args[0])} if formula.op is Op.G else {Op.G}
        if not _TEMPORAL & {part.op for part in subformulas(formula)}:
            first.append(formula)
        elif formula.bounds is None and _TEMPORAL & within <= {Op.X}:
            steps.append(formula.args[0])
        else:
            others.append(formula)
    return first, steps, others


def _quoted(text: str) -> str:
    return text.replace("\\", " ").replace('"', "'").replace("\n", " ")


def slugs(spec: Specification, period: float) -> str:
    """Return a document in slugs' structured form.

    FormulaError if a part is outside of what GR(1) can say (`gr1.gr1`).
    """
    return slugs_text(gr1(spec.assumptions, spec.guarantees, spec.inputs, spec.outputs, period))


def tulip(spec: Specification, period: float) -> str:
    """Return a Python file that makes TuLiP's GR(1) specification.

    FormulaError if a part is outside of what GR(1) can say (`gr1.gr1`).
    """
    return tulip_text(gr1(spec.assumptions, spec.guarantees, spec.inputs, spec.outputs, period))


def _subscript(bounds: Bounds) -> str:
    return f"_{{[{number(bounds[0])},{number(bounds[1])}]}}"


def _upright(name: str) -> str:
    return "\\mathit{" + name.replace("_", "\\_") + "}"


_LATEX: Final = Style(
    {
        Op.TRUE: "\\top",
        Op.FALSE: "\\bot",
        Op.NOT: "\\neg",
        Op.AND: "\\wedge",
        Op.OR: "\\vee",
        Op.IMPLIES: "\\rightarrow",
        Op.IFF: "\\leftrightarrow",
        Op.X: "\\bigcirc",
        Op.F: "\\Diamond",
        Op.G: "\\Box",
    }
    | {op: f"\\mathbin{{\\mathbf{{{op.value}}}}}" for op in (Op.U, Op.R, Op.W, Op.M, Op.S, Op.T)}
    | {op: f"\\mathbf{{{op.value}}}" for op in (Op.Y, Op.Z, Op.O, Op.H)},
    Brackets.MIXED_NEVER,
    bounds=_subscript,
    name=_upright,
    tight=False,
)


def latex(spec: Specification, period: float) -> str:  # noqa: ARG001 - all formats are called alike
    """Return the specification for LaTeX with amsmath and amssymb; bounds in seconds."""
    lines = [
        f"  \\varphi_{{\\mathrm{{{side}}}}} &= {written_together(formulas, _LATEX)}"
        for side, formulas in (("env", spec.assumptions), ("sys", spec.guarantees))
    ]
    return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}\n"


FORMATS: Final[Mapping[str, Callable[[Specification, float], str]]] = {
    "spin": spin,
    "spot": spot,
    "stl": stl,
    "tlsf": tlsf,
    "slugs": slugs,
    "tulip": tulip,
    "latex": latex,
}
"""The formats by name; all take the specification and the period, seconds."""
