"""A rehearsal: built-in controllers go through all phases of a competition; their time tells the load of a season."""

from __future__ import annotations

import dataclasses
import secrets
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.competition.competition import Competition, Phase, run_twice
from dubins_traffic.competition.judging import evaluate
from dubins_traffic.competition.submission import check_submission
from dubins_traffic.competition.templates import built_in
from dubins_traffic.problem import limits


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """What came of a phase with one controller."""

    phase: Phase
    controller: str
    trials: int
    """How many were run."""
    seconds: float
    """Of one worker, for one trial."""
    faults: tuple[str, ...]
    """Ends by the controller's or the platform's fault."""

    def load(self, submissions: int) -> float:
        """Return the seconds of one worker that so many submissions of a team take, no more than its quota lets in."""
        total = self.phase.quota.total
        count = submissions if total is None else min(submissions, total)
        trials = len(self.phase.numbers)
        return count * (trials + run_twice(trials)) * self.seconds


def rehearse(
    competition: Competition,
    controllers: Sequence[str],
    *,
    trials: int = 4,
    workers: int = 1,
    trust: bool = False,
) -> Iterator[Rehearsed]:
    """Judge controllers in all phases as a service would, from seeds that are drawn and forgotten.

    Parameters
    ----------
    controllers : sequence of str
        Names of built-in controllers.
    trials : int
        How many of each configuration, no more than the phase has; twice as many as workers tell more.
    workers : int
        Processes.
    trust : bool
        Whether they may run with fewer limits than this machine should enforce.

    Raises
    ------
    InputError
        If there is no such controller, or this machine can't hold it in its box.
    """
    with tempfile.TemporaryDirectory(prefix="rehearsal-") as name:
        place = Path(name)
        for controller in controllers:
            file = place / controller / "controller.py"
            file.parent.mkdir()
            file.write_bytes(built_in(controller))
            submission = check_submission(str(file), place / "submissions")
            for phase in competition.phases:
                seed, few = secrets.randbelow(limits.SEEDS), min(trials, phase.model.trials)
                model = phase.model.model_copy(update={"seed": seed, "trials": few})
                short = dataclasses.replace(phase, model=model)
                ended: list[float] = []
                done = evaluate(
                    short,
                    submission,
                    place / f"{phase.name}-{controller}",
                    workers=workers,
                    trust=trust,
                    progress=lambda _done, _of, ended=ended: ended.append(time.monotonic()),
                ).results
                faults = tuple(sorted({outcome.end for outcome in done if outcome.owner is not None}))
                yield Rehearsed(phase, controller, len(done), _seconds(ended, workers), faults)


def _seconds(ended: Sequence[float], workers: int) -> float:
    """Return what a trial takes one of several workers, by the times of the start and of the ends of trials.

    The first trial of each worker is left out if others follow: the worker starts meanwhile.
    """
    first = workers if len(ended) > workers + 1 else 0
    later = len(ended) - 1 - first
    return (ended[-1] - ended[first]) * min(workers, later) / later
