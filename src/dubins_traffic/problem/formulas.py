"""The formulas that a problem carries beside its task, and their checks."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import AfterValidator, Field

from dubins_traffic.logic.formula import Formula, FormulaError, propositions
from dubins_traffic.logic.parse import parse, place_of
from dubins_traffic.problem.faults import fault

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

MOST: Final = 100
"""Most formulas of a problem."""
NAME: Final = r"^[A-Za-z0-9][A-Za-z0-9_ .:-]{0,39}$"
"""Pattern of the name of a formula."""


def read_formula(name: str, text: str) -> Formula:
    """Return the formula called `name`.

    Raises
    ------
    FormulaError
        If `text` is no formula; names the field, line and column.
    """
    try:
        return parse(text)
    except FormulaError as error:
        raise error.within(field=f"formulas.{name}") from None


def check_formulas(problem: Problem, names: tuple[str, ...]) -> None:
    """Refuse a problem whose formulas can't be judged.

    Parameters
    ----------
    problem : Problem
        Carries the formulas.
    names : tuple of str
        Names of the cars, the ego's first.

    Raises
    ------
    FormulaError
        For a formula that can't be read, for a proposition that the problem lacks, with line and column, or for a
        formula that is too large to be monitored; names the field.
    """
    if not problem.formulas:
        return
    from dubins_traffic.logic.monitor import Monitors
    from dubins_traffic.rules.vocabulary import Vocabulary

    formulas = {name: read_formula(name, text) for name, text in problem.formulas.items()}
    vocabulary = Vocabulary(problem, names)
    for name, formula in formulas.items():
        for word in propositions(formula):
            try:
                vocabulary[word]
            except FormulaError as error:
                line, column = place_of(problem.formulas[name], word)
                placed = FormulaError(error.problem, line=line, column=column, **error.context)
                raise placed.within(field=f"formulas.{name}") from None
    used = {word for formula in formulas.values() for word in propositions(formula)}
    try:
        Monitors(formulas, sorted(used), problem.period)
    except FormulaError as error:
        raise error.within(field="formulas") from None


def _readable(texts: dict[str, str]) -> dict[str, str]:
    for name, text in texts.items():
        if not re.match(NAME, name):
            raise fault("not a name of a formula", f"a text matching {NAME}", value=name, field=name)
        try:
            read_formula(name, text)
        except FormulaError as error:
            raise fault(error.problem, error.expected or "a formula", name, text) from None
    return texts


Formulas = Annotated[
    dict[str, str],
    Field(max_length=MOST, json_schema_extra={"propertyNames": {"pattern": NAME}}),
    AfterValidator(_readable),
]
