"""What a search asks for: rules, goals, a formula of one's own, or the least score; what can't be found is refused."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from dubins_traffic.errors import InputError
from dubins_traffic.falsification.contract import BLOCKED, CONTRACT, PROVOKED, check_lawful
from dubins_traffic.falsification.liveness import TARGETS, check_long_enough
from dubins_traffic.falsification.trying import DONE, FORMULA
from dubins_traffic.logic.formula import propositions
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.parse import parse
from dubins_traffic.scoring.margins import LIVENESS
from dubins_traffic.scoring.verdict import EGO_RULES

if TYPE_CHECKING:
    from dubins_traffic.falsification.sampling import Source

ASKED: Final = "asked"
"""The name by which a problem carries the formula that a search asks for."""
LOOKED_AT: Final = 8
"""As many trials are looked at to see whether what is asked for can be broken."""


def targets_of(rules: Sequence[str], formula: str | None, *, least_score: bool) -> tuple[str, ...]:
    """Return what is asked for, by the names of margins (`trying.Tried`); the parameters are those of `falsify`.

    Raises
    ------
    InputError
        If a rule is none that can be asked for.
    """
    unknown = [rule for rule in rules if rule not in TARGETS]
    if unknown:
        expected = f"one of {', '.join(TARGETS)}"
        raise InputError("no rule of the ego's", file="--rule", value=unknown[0], expected=expected)
    if least_score:
        return (DONE,)
    if formula is not None:
        return (f"{FORMULA} {ASKED}",)
    return tuple(rules) or EGO_RULES


def check_targets(targets: Sequence[str], source: Source) -> None:
    """Refuse what no trial of a source can break.

    Raises
    ------
    InputError
        If goals are asked for and no trial lasts as long as a gap may, cars that keep the law where there are none, or
        a formula that can always still come true.
    """
    if not {LIVENESS, *CONTRACT, f"{FORMULA} {ASKED}"}.intersection(targets):
        return
    instances = source.draw(range(LOOKED_AT))
    for target in {LIVENESS, BLOCKED}.intersection(targets):
        check_long_enough(instances, target)
    if PROVOKED in targets:
        check_lawful(instances)
    problem = instances[0].problem
    for name, text in problem.formulas.items():
        formula = parse(text)
        if not Monitors({name: formula}, propositions(formula), problem.period).breakable:
            raise InputError(
                "no trial of any length can break it", file="--formula", value=text,
                expected="a bound, as in []<>[0,60] ego_t_1_1; --rule 1.goal asks for the goals",
            )  # fmt: skip
