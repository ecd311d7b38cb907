"""The seat of a submission: the one place where the code of a stranger is let near a trial, in a box."""

from __future__ import annotations

from dubins_traffic.competition.settings import Limits
from dubins_traffic.competition.submission import Submission
from dubins_traffic.sandbox import BoxedController, boxed_controller
from dubins_traffic.sandbox import Limits as BoxLimits

_KIB, _MIB = 1 << 10, 1 << 20


def boxed(submission: Submission, limits: Limits, *, trust: bool = False) -> BoxedController:
    """Return the controller of a submission for one trial, in a box of its own.

    Parameters
    ----------
    submission : Submission
        What drives.
    limits : Limits
        What it may use in the trial.
    trust : bool
        Whether it may drive where this machine can't enforce all limits, with those that it can.

    Raises
    ------
    InputError
        If this machine can't hold a stranger's program and `trust` is not given.
    """
    return boxed_controller(str(submission.path), box_limits(limits), trust=trust)


def box_limits(limits: Limits) -> BoxLimits:
    """Return the limits of a phase as boxes take them: seconds and bytes."""
    return BoxLimits(
        start_seconds=limits.start,
        decision_seconds=limits.decision,
        bank_seconds=limits.bank,
        wall_seconds=limits.wall,
        memory=limits.memory * _MIB,
        processes=limits.processes,
        files=limits.files * _MIB,
        output=limits.output * _KIB,
    )
