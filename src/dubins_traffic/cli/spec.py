"""`dubins-traffic spec`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Annotated

import typer

from dubins_traffic.cli import options
from dubins_traffic.cli.faults import tell
from dubins_traffic.errors import InputError

if TYPE_CHECKING:
    from dubins_traffic.logic.formula import Formula, FormulaError
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.specifications.exports import Specification

EXAMPLES = options.examples(
    "spec first.json",
    "spec out/trial-0000.mcap --guarantee",
    "spec first.json --format spin --period 1",
    "spec first.json --format tlsf -o first.tlsf",
)


class Format(StrEnum):
    """Languages in which a task can be said."""

    SPIN = "spin"
    SPOT = "spot"
    STL = "stl"
    TLSF = "tlsf"
    SLUGS = "slugs"
    TULIP = "tulip"
    LATEX = "latex"


SUFFIXES = {
    Format.TLSF: (".tlsf",),
    Format.SLUGS: (".structuredslugs",),
    Format.TULIP: (".py",),
    Format.LATEX: (".tex",),
}
"""How names of files in a language end; in the others, as `PLAIN`."""
PLAIN = (".txt", ".ltl", ".stl")
ONE_FORMULA = (Format.SPIN, Format.SPOT, Format.STL)
"""Formats that have no place of their own for assumptions."""


def spec(
    instance: Annotated[
        str, typer.Argument(metavar="INSTANCE", help="A problem instance or a record.", show_default=False)
    ],
    format: Annotated[
        Format | None,
        typer.Option(
            "--format",
            help="For which tool; without it, SPIN's syntax with past operators and bounds in seconds.",
            show_default=False,
        ),
    ] = None,
    assumption: Annotated[
        bool | None,
        typer.Option("--assumption/--guarantee", help="Only this part of the task.", show_default=False),
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(
            "--period",
            metavar="SECONDS",
            help="Length of a step, where bounds become steps; by default the control period.",
        ),
    ] = None,
    output: options.Output = None,
    overwrite: options.Replace = False,
) -> None:
    """Print the task of a problem as temporal logic: what is assumed of the others, and what the ego guarantees."""
    from dubins_traffic.specifications.task import task

    if period is not None and not 0.0 < period < math.inf:
        raise InputError("not a period", field="--period", value=period, expected="seconds > 0")
    suffixes = PLAIN if format is None else SUFFIXES.get(format, PLAIN)
    options.require(output, "a specification", suffixes, overwrite=overwrite, apart_from=[instance], standard=True)
    judged = _instance(instance)
    try:
        whole = task(judged.problem, judged.names)
    except InputError as error:
        raise error.within(file=instance) from None
    wanted = _part(whole, assumption)
    if format is None:
        text = _in_our_syntax(wanted, " &&\n" if judged.problem.rules else " && ")
    else:
        text = _in_language(wanted, format, period or judged.problem.period, instance)
    options.write(text if text.endswith("\n") else text + "\n", output)


def _instance(source: str) -> Instance:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.record.reader import Record
    from dubins_traffic.runs.sources import load

    loaded = load(source)
    if isinstance(loaded, Record):
        return loaded.instance
    if isinstance(loaded, Instance):
        if not loaded.problem.rules:
            without = "no rules of the road are in it, so the task is its goals alone"
            tell(f"{source}: {without} (`instance --full` keeps rules)")
        return loaded
    raise InputError("has no task", file=source, expected="a problem instance or a record")


def _part(whole: Specification, assumption: bool | None) -> Specification:
    """Return the assumptions of a task (true), its guarantees (false) or both, and their propositions."""
    from dubins_traffic.logic.formula import propositions

    assumptions = () if assumption is False else whole.assumptions
    guarantees = () if assumption else whole.guarantees
    used = {name for formula in (*assumptions, *guarantees) for name in propositions(formula)}
    inputs = tuple(name for name in whole.inputs if name in used)
    return type(whole)(assumptions, guarantees, inputs, tuple(name for name in whole.outputs if name in used))


def _in_our_syntax(spec: Specification, joint: str) -> str:
    """Return a specification in the syntax that we read ourselves, its conjuncts joined by `joint`."""
    from dubins_traffic.logic.formula import to_spin

    sides = [
        joint.join(f"({to_spin(formula)})" for formula in formulas).replace("[] <>", "[]<>")
        for formulas in (spec.assumptions, spec.guarantees)
        if formulas
    ]
    return "(\n" + "\n) -> (\n".join(sides) + "\n)" if len(sides) == 2 else "".join(sides) or "true"


def _in_language(spec: Specification, format: Format, period: float, source: str) -> str:
    """Return a specification in another tool's language.

    Raises
    ------
    InputError
        If it can't say it; names the formula.
    """
    from dubins_traffic.logic.formula import FormulaError
    from dubins_traffic.specifications.exports import FORMATS

    if format in ONE_FORMULA and not spec.guarantees:
        spec = replace(spec, assumptions=(), guarantees=spec.assumptions)
    write = FORMATS[format]
    try:
        return write(spec, period)
    except FormulaError as error:
        refused = error
    for formula, alone in _parts(spec):
        try:
            write(alone, period)
        except FormulaError as error:
            raise _refusal(error, refused, formula, format, source) from None
    raise refused.within(file=source, field=f"--format {format}")


def _parts(spec: Specification) -> Iterator[tuple[Formula, Specification]]:
    """Yield each formula of a specification, and a specification of it alone."""
    from dubins_traffic.logic.formula import propositions

    outputs = set(spec.outputs)
    for place, formula in enumerate((*spec.assumptions, *spec.guarantees)):
        names = propositions(formula)
        sides = ((formula,), ()) if place < len(spec.assumptions) else ((), (formula,))
        inputs = tuple(name for name in names if name not in outputs)
        yield formula, type(spec)(*sides, inputs, tuple(name for name in names if name in outputs))


def _refusal(error: FormulaError, whole: FormulaError, formula: Formula, format: Format, source: str) -> InputError:
    """Return what to say of a formula that can't be said, given what would have to change for the whole."""
    from dubins_traffic.logic.formula import to_spin

    return InputError(
        error.problem,
        file=source,
        field=f"--format {format}",
        value=to_spin(formula),
        expected=whole.expected,
    )
