"""Whether trials last long enough for the verdict `satisfied` (docs/rules.md#long-enough), told before they run."""

from __future__ import annotations

import math
from contextlib import suppress
from itertools import islice
from typing import TYPE_CHECKING

from dubins_traffic.errors import InputError
from dubins_traffic.scoring.goals import RECURRENT

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from dubins_traffic.problem.instance import Instance

LOOKED_AT = 16
"""How many trials of a run, or combinations of a campaign, are looked at beforehand."""


def least_duration(instance: Instance) -> float:
    """Return the seconds of two free-flow rounds; 0 without rules, or if no round goes through all goals.

    Norm: docs/rules.md#long-enough.
    """
    from dubins_traffic.routing.rounds import round_time  # compiles; only where it is asked for

    problem = instance.problem
    if not problem.rules:
        return 0.0
    once = round_time(problem.network, problem.goal_vertices, problem.car.bounds.speed)
    return RECURRENT * once if math.isfinite(once) else 0.0


def is_too_short(instance: Instance) -> bool:
    """Tell whether a trial ends before a car that meets nobody could drive two rounds."""
    return instance.duration < least_duration(instance)


def short_notice(makers: Iterable[Callable[[], Instance]]) -> str:
    """Return the notice that trials are too short for `satisfied`, else an empty text.

    `makers` draw the instances, of which the first `LOOKED_AT` are looked at; those that can't be drawn are left out,
    since the run itself says so.
    """
    drawn: list[Instance] = []
    for make in islice(makers, LOOKED_AT):
        with suppress(InputError):
            drawn.append(make())
    short = [(least_duration(instance), instance.duration) for instance in drawn if is_too_short(instance)]
    if not short:
        return ""
    needed, duration = max(short)
    need = f"lasts {duration:g} s, and a car that meets nobody takes {needed:.0f} s for two rounds through all goals"
    if len(drawn) == 1:
        return f"the trial is too short for the verdict `satisfied`: it {need}"
    count = f"{len(short)} of {len(drawn)} trials looked at are"
    return f"{count} too short for the verdict `satisfied`: one {need}"
