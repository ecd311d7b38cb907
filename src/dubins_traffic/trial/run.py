"""Runs a controller through a trial: start the controller (timed), step to the end, close the controller."""

from __future__ import annotations

from dubins_traffic.errors import ControllerError
from dubins_traffic.protocols import Controller, End, Ending
from dubins_traffic.record.wall import Wall, measured, summary
from dubins_traffic.trial.interrupts import heard_between_frames
from dubins_traffic.trial.seat import Seat
from dubins_traffic.trial.trial import Trial


def run(trial: Trial, controller: Controller, deadline: float | None = None) -> tuple[Ending, Wall]:
    """Run `controller` through `trial` until it ends and return its ending and wall-clock figures.

    A controller that raises, gives up (None), answers nonsense, or takes longer than `deadline` seconds for one
    `act` ends its own trial with a named reason; nothing is raised but what interrupts the program.
    """
    seat = Seat(controller, deadline, linked=trial.linked)
    with heard_between_frames():
        try:
            seat.start(trial.instance.problem, trial.tick)
            act, advance, note = seat.act, trial.advance, trial.note
            while trial.ending is None:
                advance(act(trial.observation, note))
        except (KeyboardInterrupt, SystemExit):
            trial.end(End.INTERRUPTED)
            raise
        except ControllerError as error:
            trial.end(End(error.reason), error.detail)
    ending = seat.end(trial.end(End.DURATION))
    return ending, measured(seat.begin, summary(seat.latencies), reproducible=ending.end is not End.DEADLINE)
