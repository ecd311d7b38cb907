"""Specifications in GR(1): first positions, steps and what recurs, for each side; texts for slugs and TuLiP.

Understood, after past operators have become memory that the environment keeps, and conjunctions have been split:

===========================  ==========================================================================
no temporal operator         a constraint on the first position
``G p``                      p with next at most once around: a constraint on every step
``G F p``                    p recurs
``G (a -> F p)``             an auxiliary proposition says that p is owed; it is not owed again and again
``G (a -> F[0,d] p)``        a counter of the ticks since p has been owed stays within the bound
``G (a -> G[0,d] p)``        a counter of the ticks that p is still owed
``F p``                      an auxiliary proposition says that p has been; it recurs
===========================  ==========================================================================

Auxiliary variables belong to the side whose part they serve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

from dubins_traffic.logic.formula import (
    FUTURE,
    Brackets,
    Formula,
    FormulaError,
    Op,
    Style,
    conj,
    disj,
    iff,
    implies,
    negation,
    next_,
    prop,
    propositions,
    subformulas,
    ticks,
    written,
)
from dubins_traffic.logic.monitor import parts
from dubins_traffic.logic.rewrite import FreshNames, mapped, nnf, renamed, simplify, without_past


@dataclass(frozen=True)
class Counter:
    """An integer from 0 to `limit`.

    Attributes
    ----------
    name : str
        The variable; `runs` is the proposition that it is not 0.
    limit : int
        Ticks.
    steps : tuple of (Formula, str)
        Conditions over the present position, and what the variable is at the next one.
    """

    name: str
    limit: int
    steps: tuple[tuple[Formula, str], ...]


@dataclass
class Side:
    """One side's part of a GR(1) specification."""

    variables: list[str]
    counters: list[Counter] = field(default_factory=list[Counter])
    first: list[Formula] = field(default_factory=list[Formula])
    step: list[Formula] = field(default_factory=list[Formula])
    recurs: list[Formula] = field(default_factory=list[Formula])


@dataclass(frozen=True)
class GR1:
    """A GR(1) specification: if the environment keeps its side, the system must keep its own."""

    environment: Side
    system: Side


def gr1(
    assumptions: Sequence[Formula],
    guarantees: Sequence[Formula],
    inputs: Sequence[str],
    outputs: Sequence[str],
    period: float,
) -> GR1:
    """Return the specification in GR(1).

    FormulaError if a part is of none of the forms above, or if an assumption restricts what the system chooses first
    or next.
    """
    changed, memories = without_past([*assumptions, *guarantees])
    environment = Side([*inputs, *(memory.name for memory in memories)])
    system = Side(list(outputs))
    environment.first += [memory.initially for memory in memories]
    environment.step += [memory.step for memory in memories]
    taken = FreshNames([*environment.variables, *system.variables])
    for place, formula in enumerate(changed):
        side = environment if place < len(assumptions) else system
        for part in parts(formula):
            _Sorter(side, period, taken).sort(simplify(part))
    variables = set(environment.variables)
    for formula in environment.first:
        _keep_to(variables, propositions(formula), formula, "first")
    for formula in environment.step:
        ahead = {name for part in subformulas(formula) if part.op is Op.X for name in propositions(part)}
        _keep_to(variables, sorted(ahead), formula, "next")
    return GR1(environment, system)


def _keep_to(variables: set[str], names: Sequence[str], formula: Formula, when: str) -> None:
    for name in names:
        if name not in variables:
            raise FormulaError(
                f"an assumption restricts what the system chooses {when}",
                value=str(formula),
                expected="inputs only",
            )


class _Sorter:
    """Puts one part of a conjunction where it belongs."""

    def __init__(self, side: Side, period: float, taken: FreshNames) -> None:
        self._side = side
        self._period = period
        self._taken = taken

    def sort(self, part: Formula) -> None:
        body = part.args[0] if part.args else part
        if part.op is Op.TRUE:
            return
        if not _temporal(part):
            self._side.first.append(part)
        elif part.op is Op.F and part.bounds is None and not _temporal(body):
            seen = self._proposition("seen")
            self._latch(seen, disj(prop(seen), body))
            self._side.recurs.append(prop(seen))
        elif part.op is Op.G and part.bounds is None:
            self._always(part, body)
        else:
            self._refuse(part)

    def _always(self, part: Formula, body: Formula) -> None:
        if _is_step(body):
            self._side.step.append(body)
            return
        choices = nnf(body)
        items = choices.args if choices.op is Op.OR else (choices,)
        later = [item for item in items if _temporal(item)]
        if len(later) != 1 or later[0].op not in (Op.F, Op.G) or _temporal(later[0].args[0]):
            self._refuse(part)
        request = simplify(nnf(negation(disj(*(item for item in items if item is not later[0])))))
        goal = later[0].args[0]
        if later[0].bounds is None:
            if later[0].op is Op.G:
                self._refuse(part)
            self._respond(request, goal)
            return
        low, high = (ticks(bound, self._period) for bound in later[0].bounds)
        if low > 0:
            self._refuse(part)
        elif later[0].op is Op.F:
            self._deadline(request, goal, high)
        else:
            self._hold(request, goal, high)

    def _respond(self, request: Formula, goal: Formula) -> None:
        if request.op is Op.TRUE:
            self._side.recurs.append(goal)
            return
        owed = self._proposition("owed")
        self._latch(owed, conj(disj(request, prop(owed)), negation(goal)))
        self._side.recurs.append(negation(prop(owed)))

    def _deadline(self, request: Formula, goal: Formula, limit: int) -> None:
        name = self._name("ticks")
        owed = simplify(conj(disj(request, prop(f"{name}_runs")), negation(goal)))
        late = prop(f"{name}_full")
        steps = ((conj(owed, negation(late)), f"{name} + 1"), (negation(owed), "0"))
        self._side.counters.append(Counter(name, limit, steps))
        self._side.step.append(negation(conj(owed, late)))

    def _hold(self, request: Formula, goal: Formula, limit: int) -> None:
        name = self._name("left")
        runs = prop(f"{name}_runs")
        steps = (
            (request, str(limit)),
            (simplify(conj(negation(request), runs)), f"{name} - 1"),
            (simplify(conj(negation(request), negation(runs))), "0"),
        )
        self._side.counters.append(Counter(name, limit, steps))
        self._side.step.append(simplify(implies(disj(request, runs), goal)))

    def _proposition(self, stem: str) -> str:
        name = self._name(stem)
        self._side.variables.append(name)
        return name

    def _name(self, stem: str) -> str:
        name = self._taken.make(stem)
        self._taken.take(f"{name}_runs", f"{name}_full")
        return name

    def _latch(self, name: str, update: Formula) -> None:
        self._side.first.append(negation(prop(name)))
        self._side.step.append(iff(next_(prop(name)), update))

    def _refuse(self, part: Formula) -> None:
        raise FormulaError(
            "not of a form that GR(1) knows",
            value=str(part),
            expected="a first position, G p, G F p, G (a -> F p), G (a -> F[0,d] p), G (a -> G[0,d] p) or F p",
        )


def _temporal(formula: Formula) -> bool:
    return any(part.op in FUTURE for part in subformulas(formula))


def _is_step(formula: Formula) -> bool:
    """Say whether the only temporal operator is next, nowhere inside another next."""
    return all(part.op is Op.X and not _temporal(part.args[0]) for part in subformulas(formula) if part.op in FUTURE)


def _style(counters: Sequence[Counter]) -> Style:
    """Return the style of formulas with comparisons for counters."""
    known = {f"{counter.name}_runs": f"({counter.name} > 0)" for counter in counters}
    known |= {f"{counter.name}_full": f"({counter.name} = {counter.limit})" for counter in counters}
    return Style(
        {Op.AND: "&", Op.OR: "|", Op.TRUE: "TRUE", Op.FALSE: "FALSE"},
        Brackets.ALL,
        name=lambda name: known.get(name, name),
    )


def _texts(style: Style, formulas: Sequence[Formula]) -> list[str]:
    """Return formulas with primes for next."""
    return [written(mapped(formula, _primed), style) for formula in formulas]


def _primed(part: Formula) -> Formula:
    if part.op is not Op.X:
        return part
    return renamed(part.args[0], {name: name + "'" for name in propositions(part)})


@dataclass(frozen=True)
class _Text:
    first: list[str]
    step: list[str]
    recurs: list[str]


def _side_texts(spec: GR1) -> tuple[_Text, _Text]:
    """Return the texts of the environment and of the system."""
    style = _style([*spec.environment.counters, *spec.system.counters])
    return _side_text(spec.environment, style), _side_text(spec.system, style)


def _side_text(side: Side, style: Style) -> _Text:
    first = _texts(style, side.first) + [f"{counter.name} = 0" for counter in side.counters]
    step = _texts(style, side.step)
    for counter in side.counters:
        conditions = _texts(style, [condition for condition, _ in counter.steps])
        step += [
            f"({condition}) -> ({counter.name}' = {value})"
            for condition, (_, value) in zip(conditions, counter.steps, strict=True)
        ]
    return _Text(first, step, _texts(style, side.recurs))


def slugs_text(spec: GR1) -> str:
    """Return the specification in slugs' structured form."""
    environment, system = _side_texts(spec)
    sections: Final = {
        "INPUT": _declared(spec.environment),
        "OUTPUT": _declared(spec.system),
        "ENV_INIT": environment.first,
        "SYS_INIT": system.first,
        "ENV_TRANS": environment.step,
        "SYS_TRANS": system.step,
        "ENV_LIVENESS": environment.recurs,
        "SYS_LIVENESS": system.recurs,
    }
    return "\n".join(line for name, lines in sections.items() for line in (f"[{name}]", *lines, ""))


def _declared(side: Side) -> list[str]:
    return side.variables + [f"{counter.name}:0...{counter.limit}" for counter in side.counters]


def tulip_text(spec: GR1) -> str:
    """Return a Python file that makes the specification with TuLiP."""
    texts = _side_texts(spec)
    lines = [
        '"""GR(1) specification for TuLiP."""',
        "",
        "from tulip.spec.form import GRSpec",
        "",
        "specification = GRSpec(",
    ]
    for prefix, side, text in zip(("env", "sys"), (spec.environment, spec.system), texts, strict=True):
        domains: dict[str, object] = dict.fromkeys(side.variables, "boolean")
        domains |= {counter.name: (0, counter.limit) for counter in side.counters}
        lines += [
            f"    {prefix}_vars={{",
            *(f"        {name!r}: {domain!r}," for name, domain in domains.items()),
            "    },",
        ]
        for name, items in (("init", text.first), ("safety", text.step), ("prog", text.recurs)):
            lines += [f"    {prefix}_{name}=[", *(f"        {item!r}," for item in items), "    ],"]
    lines += ["    moore=False,", "    plus_one=False,", "    qinit='\\\\A \\\\E',", ")"]
    return "\n".join(lines) + "\n"
