"""Commands that come late: what a driver sees when the command that it gives now takes effect."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Any, NamedTuple

from dubins_traffic.cars.state import Command, Observation, Pose, Propositions, Twist
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.kernels.trig import advance
from dubins_traffic.rules.breaches import FIRST_AND_CLEAR, lasted, run
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import ticks

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class Patience(NamedTuple):
    """How long a car waits for its place to be certain, and for how long it is."""

    settles: int
    """For how many ticks it has to be first before it counts as first."""
    lasts: int
    """For how many ticks it may be first without a move, at most."""

    @classmethod
    def of(cls, problem: Problem, delay: int) -> Patience:
        """Return the patience of a car whose commands take effect `delay` ticks late."""
        rules = RuleParameters.from_mapping(problem.rules)
        return cls(ticks(rules.group_time, problem.rate), ticks(rules.forfeit_time, problem.rate) - delay - 1)


@jit_inline
def settle(bits: Any, tick: int, first_since: int, clear_since: int, patience: Patience) -> tuple[Any, int, int]:
    """Return flags in which a car is first only if that lasts until its next command takes effect.

    With its flags, `bits` (count), come the ticks since which it is first, and first at a clear crossing, -1 if it is
    not; `first_since` (index) and `clear_since` (index) are these before frame `tick`.

    Notes
    -----
    Who stops within `group_time` of the car may come before it, and the car forfeits its place after `forfeit_time`.
    """
    first = bits & FLAG.FIRST != 0
    first_since = run(first, tick, first_since)
    clear_since = run(bits & FIRST_AND_CLEAR == FIRST_AND_CLEAR, tick, clear_since)
    settled = lasted(tick, first_since) >= patience.settles
    if first and not (settled and lasted(tick, clear_since) < patience.lasts):
        bits = bits & ~FLAG.FIRST | FLAG.AHEAD
    return bits, first_since, clear_since


class InFlight:
    """The ego's commands that have not taken effect yet (`Problem.command_delay`).

    Notes
    -----
    Where these commands take the ego is known to the bit, unless its observations are noisy or commands get lost. What
    the others do meanwhile is not: `policies.safety.travel_of` counts how far they can get. The order of arrival may
    change as well (`settle`).
    """

    def __init__(self, problem: Problem) -> None:
        self._under_way = deque([Command(0.0, 0.0)] * problem.command_delay)
        self._period = problem.period
        self._patience = Patience.of(problem, problem.command_delay)
        self._first_since = self._clear_since = -1

    def ahead(self, seen: Observation) -> Observation:
        """Return what is seen with the ego where it will be when the next command takes effect."""
        if not self._under_way:
            return seen
        pose = seen.pose
        for speed, yaw_rate in self._under_way:
            pose = Pose(*advance(*pose, speed, yaw_rate, self._period))
        twist = Twist(*self._under_way[-1])
        return seen._replace(pose=pose, twist=twist, propositions=self._settled(seen.tick, seen.propositions))

    def sent(self, command: Command) -> Command:
        """Keep a command, clipped to the car's bounds, until it takes effect, and return it."""
        if self._under_way:
            self._under_way.popleft()
            self._under_way.append(command)
        return command

    def _settled(self, tick: int, seen: Propositions) -> Propositions:
        bits, self._first_since, self._clear_since = settle(
            seen.bits, tick, self._first_since, self._clear_since, self._patience
        )
        return seen._replace(bits=bits)
