"""The winning strategy of the game of cells, solved when a trial starts, where the game is small enough.

Piterman, Pnueli, Sa'ar, Synthesis of reactive(1) designs, VMCAI 2006, eq. 2.
"""

from __future__ import annotations

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.problem.instance import Problem
from dubins_traffic.synthesis.instance import board_of
from dubins_traffic.synthesis.synthesized import Synthesized

MOST = 3_000_000
"""Positions of the largest game that is solved: some seconds, and half a gigabyte."""


class Gr1(Synthesized):
    """Drives as `synthesized`; gives up where the game is too large."""

    def start(self, problem: Problem) -> None:
        """Solve the game."""
        self._solved = not problem.e_agents or board_of(problem).positions <= MOST
        if self._solved:
            super().start(problem)

    def act(self, observation: Observation) -> Command | None:
        """Return the command, or give up."""
        return super().act(observation) if self._solved else None


class GivesUp:
    """Gives up at once."""

    def start(self, _problem: Problem) -> None:
        """Look at nothing."""

    def act(self, _observation: Observation) -> Command | None:
        """Give up."""
        return None
