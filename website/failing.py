"""Controllers of the gallery, each of which fails in one way after four seconds."""

import time

from dubins_traffic import Observation, Problem


class _Failing:
    def start(self, problem: Problem) -> None: ...

    def act(self, observation: Observation) -> tuple[float, float] | None:
        return self.fail() if observation.tick == 120 else (0.2, 0.0)

    def fail(self) -> tuple[float, float] | None:
        raise NotImplementedError


class GivesUp(_Failing):
    """It says that it can't go on."""

    def fail(self) -> None:
        """Answer nothing."""
        return


class Raises(_Failing):
    """It has a mistake in it."""

    def fail(self) -> None:
        """Divide by nothing."""
        raise ZeroDivisionError("division by a distance of 0 m")


class Sleeps(_Failing):
    """It takes longer than the deadline."""

    def fail(self) -> tuple[float, float]:
        """Wait a second."""
        time.sleep(1.0)
        return 0.2, 0.0
