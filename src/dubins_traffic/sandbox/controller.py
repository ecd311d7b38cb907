"""A controller in a box, as a trial knows it."""

from __future__ import annotations

import base64
import pickle
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Self

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.errors import InputError
from dubins_traffic.problem.public_problem import problem_to_document
from dubins_traffic.protocols import End
from dubins_traffic.sandbox.available import available_layers
from dubins_traffic.sandbox.box import Box, BoxOverError
from dubins_traffic.sandbox.launch import Program
from dubins_traffic.sandbox.layers import INSTALL, Layers
from dubins_traffic.sandbox.limits import BoxEnd, Limits
from dubins_traffic.sandbox.submission import program_of
from dubins_traffic.transports.line_messages import (
    AnswerError,
    command_in,
    message_in,
    observation_to_document,
)
from dubins_traffic.transports.lines import as_line

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

TRUST: Final = "trust"
"""Stands among the limits of a name where `boxed_controller` is told to trust."""


class BoxedController:
    """Drives by a program in a box, a new one for each trial (a `protocols.Controller`).

    Attributes
    ----------
    end : BoxEnd or None
        How the last driving ended, None if with its trial.
    log_tail : str
        The last that the program printed in the last trial.
    seconds : float
        Processor time that its box used in the last trial, from its start on.
    """

    def __init__(self, program: Program, limits: Limits, layers: Layers) -> None:
        self._program, self._limits, self._layers = program, limits, layers
        self._box: Box | None = None
        self._reports: tuple[tuple[str, str], ...] = ()
        self._reported = 0
        self.end: BoxEnd | None = None
        self.log_tail = ""
        self.seconds = 0.0

    def __deepcopy__(self, memo: object) -> Self:
        """Refuse: a program drives in one trial at a time."""
        raise InputError("a controller in a box can't go on in two trials", field="controller", expected="one of ours")

    def start(self, problem: Problem) -> None:
        """Begin a box and tell its program the problem."""
        self._drop()
        self.end, self.log_tail, self._reports, self._reported = None, "", (), 0
        try:
            self._box = Box(self._program, self._limits, self._layers)
            if self._program.shim:
                self._start_shim(self._box, problem)
            else:
                self._box.ask(as_line({"problem": problem_to_document(problem)}), answered=False)
        except (BoxOverError, AnswerError) as error:
            raise self._over(error) from None

    @staticmethod
    def _start_shim(box: Box, problem: Problem) -> None:
        """Hand our shim the problem, pickled: to read the document of one it would have to load what checks it."""
        pickled = base64.b64encode(pickle.dumps(problem)).decode()
        if message_in(box.ask(as_line({"pickled": pickled}))) != {"started": True}:
            raise AnswerError(End.PEER_GARBAGE, "it did not say that it has started")
        box.decide()

    def act(self, observation: Observation) -> Command:
        """Return the command that answers a frame."""
        box = self._box
        assert box is not None
        try:
            line = box.ask(as_line({"frame": observation_to_document(observation)}))
            answer = command_in(line, observation.tick)
        except (BoxOverError, AnswerError) as error:
            raise self._over(error) from None
        if observation.tick == 0:
            box.decide()
        self._note(box, answer.reports)
        return Command(answer.speed, answer.yaw_rate)

    def _note(self, box: Box, reports: tuple[tuple[str, str], ...]) -> None:
        """Keep the reports of a decision; those of a trial are limited like printed output, since records hold them."""
        self._reports = reports
        self._reported += sum(len(kind) + len(detail) for kind, detail in reports)
        if self._reported > self._limits.output:
            detail = f"it reported more than {self._limits.output} characters"
            raise self._over(box.fault(End.OUTPUT_FLOOD, detail))

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what the controller has reported with its last command."""
        return self._reports

    def close(self) -> None:
        """Tell the program that its trial is over, and end its box."""
        box = self._box
        if box is None:
            return
        try:
            if box.over is None and self._program.shim:
                box.part()
                message_in(box.ask(as_line({"end": {}})))
        except AnswerError as error:
            raise CloseError(error.detail) from None
        finally:
            self._drop()

    def _over(self, error: BoxOverError | AnswerError) -> BoxOverError:
        """Note how the driving ended, and end the box."""
        if isinstance(error, AnswerError):
            assert self._box is not None
            error = self._box.fault(error.end, error.detail)
        self.end = error.end
        self._drop()
        return error

    def _drop(self) -> None:
        if self._box is not None:
            self.log_tail, self.seconds = self._box.log_tail, self._box.seconds()
            self._box.close()
            self._box = None

    def __del__(self) -> None:
        """Leave no box behind."""
        self._drop()


class CloseError(Exception):
    """What the controller in a box raised when it was closed."""


def boxed_controller(
    path: str, limits: Limits | None = None, *, trust: bool = False, layers: Layers | None = None
) -> BoxedController:
    """Return a controller that drives in a box; nothing of it is loaded in this process.

    Parameters
    ----------
    path : str
        What drives; see `submission.program_of`.
    trust : bool
        Whether it may drive where this machine can't enforce all limits, with those that it can.
    layers : Layers, optional
        The layers of its boxes; by default all that this machine has.

    Raises
    ------
    InputError
        If there is no such controller, or this machine can't hold a stranger's program and `trust` is not given.
    """
    program = program_of(path)
    held = available_layers() if layers is None else layers
    if not trust and layers is None:
        held.require()
    if program.image and not held.boxes:
        raise InputError("a container image drives in a box alone", value=path, expected=INSTALL)
    return BoxedController(program, limits or Limits(), held)


def named(path: str, text: str) -> BoxedController:
    """Return a controller in a box as a name tells: what drives, and its limits, ``trust`` perhaps among them.

    InputError as `boxed_controller`, and if there is no such limit.
    """
    parts = [part for part in text.split(",") if part]
    limits = Limits.from_text(",".join(part for part in parts if part != TRUST))
    return boxed_controller(path, limits, trust=TRUST in parts)
