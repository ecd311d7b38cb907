"""The seat of a submission: the one place where the code of a stranger is let near a trial."""

from __future__ import annotations

from typing import Protocol

from dubins_traffic.competition.settings import Limits
from dubins_traffic.competition.submission import Submission
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.protocols import Controller


class Boxed(Protocol):
    """The controller of a submission in its box."""

    @property
    def controller(self) -> Controller:
        """Who drives."""
        ...

    @property
    def log(self) -> str:
        """The tail of what it has printed."""
        ...


class _InProcess:
    def __init__(self, spec: str) -> None:
        self.controller = controllers.made(lambda: controllers.load(spec))
        self.log = ""


def boxed(submission: Submission, limits: Limits, *, trust: bool = False) -> Boxed:  # noqa: ARG001
    """Return the controller of a submission for one trial, within its limits."""
    return _InProcess(f"{submission.path}/controller.py:Controller")
