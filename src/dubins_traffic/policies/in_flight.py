"""Commands that come late: what an ego's driver sees when the command that it gives now takes effect."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING

from dubins_traffic.cars.state import Command, Observation, Pose, Propositions, Twist
from dubins_traffic.kernels.trig import advance
from dubins_traffic.rules.breaches import FIRST_AND_CLEAR, lasted, run
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.tables import ticks

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem


class InFlight:
    """The ego's commands that have not taken effect yet (`Problem.command_delay`).

    Notes
    -----
    Where these commands take the ego is known to the bit, unless its observations are noisy or commands get lost. What
    the others do meanwhile is not: `policies.safety.travel_of` counts how far they can get. The order of arrival may
    change as well: who stops within `group_time` of the ego may come before it, and the ego forfeits its place after
    `forfeit_time`. So its place counts as the first only if it still is when the command takes effect.
    """

    def __init__(self, problem: Problem) -> None:
        rules = RuleParameters.from_mapping(problem.rules)
        self._under_way = deque([Command(0.0, 0.0)] * problem.command_delay)
        self._period = problem.period
        self._settles = ticks(rules.group_time, problem.rate)
        self._lasts = ticks(rules.forfeit_time, problem.rate) - problem.command_delay - 1
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
        """Return propositions in which the ego is first only if that lasts until the command takes effect."""
        first = seen.bits & FLAG.FIRST != 0
        self._first_since = run(first, tick, self._first_since)
        self._clear_since = run(seen.bits & FIRST_AND_CLEAR == FIRST_AND_CLEAR, tick, self._clear_since)
        settled = lasted(tick, self._first_since) >= self._settles
        if not first or (settled and lasted(tick, self._clear_since) < self._lasts):
            return seen
        return seen._replace(bits=seen.bits & ~FLAG.FIRST | FLAG.AHEAD)
