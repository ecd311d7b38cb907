"""Egos that drive oddly and break nothing: what `experiments.odd_egos` puts among cars that keep the rules.

Each drives as the controller `rules` says until its habit takes over, and all under the shield, so that they stay
clean.
"""

from __future__ import annotations

import random
from typing import Final

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.problem.instance import Problem
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.shield.filter import ShieldFilter

GOES: Final = FLAG.STOPPED | FLAG.FIRST | FLAG.CLEAR
NEAR: Final = 2.5
"""What is farther away than this is not beside the ego, metres."""


class Odd:
    """An ego with a habit, which drives as `rules` does till this takes over; the base of all of them.

    Parameters
    ----------
    seed : int
        What its whims follow from.

    Attributes
    ----------
    dice : random.Random
        Its whims.
    law : Command
        What `rules` would do in the present tick.
    """

    def __init__(self, seed: int) -> None:
        self.dice = random.Random(seed)
        self.law = Command(0.0, 0.0)
        self._rules = Rules()
        self._shield_filter = ShieldFilter()
        self._hold: tuple[float, float] = (0.0, 0.0)
        self._until = -1
        self._crosses = self._at = -1
        self._bits = 0

    def start(self, problem: Problem) -> None:
        """Prepare `rules` and the shield."""
        self.problem = problem
        self.bounds = problem.car.bounds
        self._rules.start(problem)
        self._shield_filter.start(problem)

    def act(self, observation: Observation) -> Command:
        """Do as the habit says, as far as the shield lets it."""
        self.law = self._rules.act(observation)
        asked = self._hold if observation.tick < self._until else self.habit(observation)
        seen = observation.propositions
        self._crosses, self._at, self._bits = seen.crosses, seen.at, seen.bits
        return self._shield_filter.filter(observation, asked)

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Return the speed and yaw rate asked for in this tick."""
        raise NotImplementedError(f"no habit, at {observation.time} s")

    def keep(
        self, observation: Observation, seconds: float, command: tuple[float, float] = (0.0, 0.0)
    ) -> tuple[float, float]:
        """Hold a command for so long, standing by default; return it."""
        self._hold = command
        self._until = observation.tick + round(seconds * self.problem.rate)
        return command

    def stand(self, observation: Observation, least: float, most: float) -> tuple[float, float]:
        """Stand for a while between two durations, seconds."""
        return self.keep(observation, self.dice.uniform(least, most))

    def degree(self, v: int) -> int:
        """Return the degree of an intersection, 0 of none."""
        return len(self.problem.network.arms(v)) if v >= 0 else 0

    def likes(self, v: int) -> bool:
        """Tell whether the habit takes over at an intersection: mostly in bends and dead ends."""
        return self.dice.random() < (0.8 if self.degree(v) < 3 else 0.4)


class Tail(Odd):
    """Stands behind an intersection with its tail in the disc."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand once the centre has left the disc."""
        seen = observation.propositions
        if self._at >= 0 > seen.at and seen.crosses == self._at and self.likes(self._at):
            return self.stand(observation, 3.0, 75.0)
        return self.law


class Behind(Odd):
    """Stands just behind an intersection, its body clear of the disc by up to half a metre."""

    _soon = -1

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand soon after the body has left the disc."""
        seen = observation.propositions
        if self._crosses >= 0 > seen.crosses and seen.lane >= 0 and self.likes(self._crosses):
            self._soon = observation.tick + self.dice.randrange(24)
        if observation.tick == self._soon:
            return self.stand(observation, 3.0, 75.0)
        return self.law


class Nose(Odd):
    """Stands before an intersection with its nose in the disc, or just before it."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand once the body has come into the disc."""
        seen = observation.propositions
        if seen.crosses >= 0 > self._crosses and seen.at < 0 and self.likes(seen.crosses):
            return self.stand(observation, 3.0, 75.0)
        return self.law


class Swings(Odd):
    """Moves 0.2 m to and fro on the road, most of all before a follower."""

    _swings = 0

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Swing forth and back some times."""
        if self._swings > 0:
            self._swings -= 1
            sign = 1.0 if self._swings % 2 else -1.0
            speed = self.dice.choice((0.1, 0.2, 0.4))
            return self.keep(observation, 0.2 / speed, (sign * speed, 0.0))
        seen = observation.propositions
        if seen.lane < 0 or seen.bits & FLAG.LEFT:
            return self.law
        followed = any(
            car.propositions.lane == seen.lane and self._is_behind(observation, car.pose) for car in observation.others
        )
        if self.dice.random() < (0.03 if followed else 0.004):
            self._swings = 2 * self.dice.randrange(5, 60)
        return self.law

    @staticmethod
    def _is_behind(observation: Observation, pose: tuple[float, float, float, float]) -> bool:
        x, y, c, s = observation.pose
        dx, dy = pose[0] - x, pose[1] - y
        return dx * dx + dy * dy < NEAR * NEAR and dx * c + dy * s < 0.0


class Creeps(Odd):
    """Drives at a few centimetres a second for minutes."""

    _speed = 1.0
    _change = 0

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Drive slowly, and again at its usual speed."""
        if observation.tick >= self._change:
            slow = self.dice.random() < 0.7
            self._speed = self.dice.uniform(0.01, 0.1) if slow else self.bounds.speed
            self._change = observation.tick + round(self.problem.rate * self.dice.uniform(5.0, 50.0))
        speed, yaw_rate = self.law
        share = min(1.0, self._speed / speed) if speed > 0.0 else 1.0
        return speed * share, yaw_rate * share


class Turns(Odd):
    """Turns round and round in discs."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Turn on the spot for a while, somewhere in the disc."""
        seen = observation.propositions
        if seen.at >= 0 and self.dice.random() < 0.02:
            rate = self.dice.choice((-1.0, 1.0)) * self.dice.uniform(0.2, 1.0) * self.bounds.yaw_rate
            speed = self.dice.choice((0.0, 0.0, 0.1, 0.3)) * self.bounds.speed
            return self.keep(observation, self.dice.uniform(1.0, 25.0), (speed, rate))
        return self.law


class Random(Odd):
    """Drives at random; the shield keeps it clean."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Hold a command at random, most of them forward, for up to 2 s."""
        if self.dice.random() < 0.3:
            return self.keep(observation, self.dice.uniform(0.0, 4.0), self.law)
        command = (
            self.bounds.speed * self.dice.uniform(-0.6, 1.0),
            self.bounds.yaw_rate * self.dice.uniform(-1.0, 1.0) * self.dice.random(),
        )
        return self.keep(observation, self.dice.uniform(0.0, 2.0), command)


class Refuses(Odd):
    """Stops at a line and does not enter, for a long time or for ever."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand once it has stopped."""
        bits = observation.propositions.bits
        if bits & FLAG.STOPPED and not self._bits & FLAG.STOPPED and self.dice.random() < 0.8:
            return self.stand(observation, 2.0, 120.0)
        return self.law


class Retakes(Odd):
    """Stops at a line, backs out of the queue, comes again, and again: always a new ticket."""

    _left = 0

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stop as soon as it may, and back up until it has no ticket."""
        bits = observation.propositions.bits
        if bits & FLAG.APPROACH and not self._bits & (FLAG.APPROACH | FLAG.STOPPED):
            if self._left <= 0:
                self._left = self.dice.randrange(1, 12)
            self._left -= 1
            return self.keep(observation, 0.6)
        if self._left > 0 and bits & FLAG.STOPPED:
            return -0.2, 0.0
        return self.law


class Settles(Odd):
    """Stands in the disc of a goal or of a dead end."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand somewhere in the disc."""
        at = observation.propositions.at
        chosen = at >= 0 and (at in self.problem.goal_vertices or self.degree(at) < 2)
        if chosen and self.dice.random() < 0.03:
            return self.stand(observation, 5.0, 120.0)
        return self.law


class Backs(Odd):
    """Backs up within the 0.3 m that are no turning round, stands, and drives on."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Back up now and then."""
        if observation.propositions.lane >= 0 and self.dice.random() < 0.01:
            speed = self.dice.uniform(0.05, 0.6)
            return self.keep(observation, self.dice.uniform(0.1, 0.3) / speed, (-speed, 0.0))
        if self._hold[0] < 0.0:
            return self.stand(observation, 0.0, 8.0)
        return self.law


class Hesitates(Odd):
    """Enters a crossing at the last moment, and stops in it."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Wait while it may, then stand within."""
        seen = observation.propositions
        if seen.bits & GOES == GOES and self._bits & GOES != GOES:
            return self.stand(observation, 1.0, 2.95)
        if seen.crosses >= 0 and self.degree(seen.crosses) > 2 and self.dice.random() < 0.02:
            return self.stand(observation, 2.0, 60.0)
        return self.law


class Jerks(Odd):
    """Stops anywhere, and drives on, all the time."""

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand now and then, for a moment or long."""
        if self.dice.random() < 0.03:
            return self.stand(observation, 0.2, self.dice.choice((1.0, 3.0, 15.0, 70.0)))
        return self.law


class Races(Odd):
    """Stands until somebody passes it, then keeps beside him."""

    _waits = -1

    def habit(self, observation: Observation) -> tuple[float, float]:
        """Stand before a follower; drive on while he is beside."""
        seen = observation.propositions
        x, y, c, s = observation.pose
        for car in observation.others:
            dx, dy = car.pose.x - x, car.pose.y - y
            ahead = dx * c + dy * s
            if not car.propositions.bits & FLAG.LEFT or dx * dx + dy * dy > 1.0:
                continue
            speed = car.twist.speed if abs(ahead) < 0.1 else 0.7 if ahead > 0.0 else 0.0
            return (speed, self.law.yaw_rate)
        long_ago = observation.tick > self._waits + 30 * self.problem.rate
        if seen.lane >= 0 and long_ago and self.dice.random() < 0.02:
            self._waits = observation.tick
        if observation.tick < self._waits + 15 * self.problem.rate and self._waits >= 0:
            return 0.0, 0.0
        return self.law


KINDS: Final[tuple[type[Odd], ...]] = (
    Tail, Swings, Behind, Creeps, Turns, Random, Refuses, Retakes, Settles, Backs, Hesitates, Nose, Jerks, Races,
)  # fmt: skip
