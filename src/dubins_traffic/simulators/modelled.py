"""Moves cars of other models than the Dubins car, one trial at a time: each tick in parts, each part on exact arcs.

A car model says which arcs its car drives in a tick (`cars.dynamics.MotionModel`). The tick is cut wherever an arc of
any car ends. Within a part every car drives one arc, so that `cars.motion` moves it and finds its contacts as exactly
as those of Dubins cars. A car that a contact fixes stands for the rest of the tick.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice, pairwise
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from dubins_traffic import outside
from dubins_traffic.cars.clip_and_move import clip
from dubins_traffic.cars.dynamics import MOST_ARCS, Arc, MotionModel, Stops, begun
from dubins_traffic.cars.motion import OUTCOME, Meeting, Motion, enlarged, step_part
from dubins_traffic.cars.state import EGO, Contact
from dubins_traffic.errors import ControllerError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.calls import bound
from dubins_traffic.protocols import End

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

ROUNDING = 1e-9
"""Tolerance, as a share of a tick: for the total time of a car's arcs, and for instants to count as equal."""
T = TypeVar("T")


class ModelledCars:
    """The cars of one trial, each moved by its model.

    Parameters
    ----------
    instance : Instance
        Whose cars these are.
    motion : Motion
        The tables of the trial; enlarged ones take their place.

    Raises
    ------
    InputError
        If a model can't begin.
    """

    def __init__(self, instance: Instance, motion: Motion) -> None:
        problem = instance.problem
        self.motion = motion
        self._spec = problem.car.model
        self._period = 1.0 / problem.rate
        self._models = [begun(problem.car, self._period) for _ in instance.starts]
        self._arcs = np.zeros((1, len(self._models), 2))
        self._stands = np.zeros(len(self._models), dtype=np.int64)
        self._move = bound(step_part)
        self._clip = bound(clip)

    def step(self, commands: Floats, contact_of: Callable[[Meeting], Contact]) -> tuple[Contact, ...]:
        """Clip `commands` (1, N, 2) in place, move for one tick and return its contacts.

        Raises
        ------
        ControllerError
            If a model raises, or answers something else than it must: the trial ends as `world_lost`.
        """
        self._take(commands)
        rows: list[list[float]] = commands[0].tolist()
        plans = [self._plan(n, model, *rows[n]) for n, model in enumerate(self._models)]
        cuts = self._cuts(plans)
        self._stands[:] = 0
        moved = np.zeros(len(plans), dtype=bool)
        contacts: list[Contact] = []
        for begin, end in pairwise(cuts):
            middle = 0.5 * (begin + end)
            for n, plan in enumerate(plans):
                self._arcs[0, n] = plan.at(middle)
            self._part(end - begin)
            for meeting in self.motion.work.meetings():
                contacts.append(_later(contact_of(meeting), begin, moved))
            moved |= self._moves()
            self._stands |= self.motion.work.until[: len(plans)] < end - begin
        for n in np.flatnonzero(self._stands):
            model = self._models[n]
            if isinstance(model, Stops):
                self._answer(int(n), "stop", model.stop)
        return tuple(contacts)

    def _take(self, commands: Floats) -> None:
        """Clip the commands in place, by the models and then by the bounds."""
        for n, model in enumerate(self._models):
            speed, yaw_rate = commands[0, n].tolist()
            taken = self._answer(n, "clip", lambda own=model, u=speed, w=yaw_rate: own.clip(u, w))
            commands[0, n] = self._numbers(n, "clip", taken, 2)
        state, rows = self.motion.state, self.motion.rows
        self._clip(rows, 0, commands[0], state.speed[0], state.yaw_rate[0], 0, len(self._models))

    def _plan(self, n: int, model: MotionModel, speed: float, yaw_rate: float) -> _Plan:
        most = MOST_ARCS + 1
        arcs: Any = self._answer(n, "advance", lambda: tuple(islice(model.advance(speed, yaw_rate), most)))
        if not 1 <= len(arcs) < most:
            arcs_named = "0 arcs" if not arcs else f"more than {MOST_ARCS} arcs"
            raise self._lost(n, "advance", arcs_named, f"1 to {MOST_ARCS} arcs")
        rows = [self._numbers(n, "advance", arc, 3) for arc in arcs]
        ends = np.cumsum([seconds for _, _, seconds in rows])
        if min(seconds for _, _, seconds in rows) < 0.0 or abs(ends[-1] / self._period - 1.0) > ROUNDING:
            expected = f"arcs that last {self._period:.6g} s together, none shorter than 0 s"
            raise self._lost(n, "advance", f"arcs that last {ends[-1]:.6g} s", expected)
        return _Plan(rows, ends.tolist())

    def _cuts(self, plans: Sequence[_Plan]) -> list[float]:
        """Return the instants, s, at which an arc of any car ends, from 0 to the end of the tick."""
        slack = ROUNDING * self._period
        cuts = [0.0]
        for end in sorted({end for plan in plans for end in plan.ends}):
            if cuts[-1] + slack < end < self._period - slack:
                cuts.append(end)
        return [*cuts, self._period]

    def _part(self, seconds: float) -> None:
        """Move all cars along their arcs, enlarging the buffer of pairs as needed."""
        self.motion.work.found[0] = 0
        while self._move(seconds, self._arcs, self._stands, self.motion) == OUTCOME.CROWDED:
            self.motion = self.motion.replace(work=enlarged(self.motion.work))

    def _moves(self) -> Any:
        """Tell for each car whether it has moved, or as a rectangle turned, in this part."""
        speed, yaw_rate = self._arcs[0].T
        turns = self.motion.cars.half_length[0] > 0.0
        return (self._stands == 0) & ((speed != 0.0) | (turns & (yaw_rate != 0.0)))

    def _answer(self, n: int, method: str, call: Callable[[], T]) -> T:
        try:
            return call()
        except Exception as error:
            raise self._lost(n, method, outside.plainly(error), "no exception") from error

    def _numbers(self, n: int, method: str, row: Any, count: int) -> Any:
        """Return a row of finite numbers."""
        try:
            numbers = tuple(float(number) for number in row)
        except (TypeError, ValueError):
            numbers = ()
        if len(numbers) != count or not all(map(math.isfinite, numbers)):
            raise self._lost(n, method, repr(row), f"{count} finite numbers")
        return numbers

    def _lost(self, n: int, method: str, got: str, expected: str) -> ControllerError:
        who = "the ego" if n == EGO else f"car {n}"
        detail = f"the model {self._spec} of {who} is not fit: {method} gave {got}; expected {expected}"
        return ControllerError(End.WORLD_LOST.value, detail)


class _Plan:
    """The arcs of one car in a tick, and when each ends, s."""

    def __init__(self, arcs: Sequence[Arc], ends: Sequence[float]) -> None:
        self._arcs = arcs
        self.ends = ends

    def at(self, time: float) -> tuple[float, float]:
        """Return speed and yaw rate at an instant of the tick, s."""
        for (speed, yaw_rate, _), end in zip(self._arcs, self.ends, strict=True):
            if time < end:
                return speed, yaw_rate
        return self._arcs[-1][:2]


def _later(contact: Contact, seconds: float, moved: Any) -> Contact:
    """Return a contact of a part as one of the tick; `moved` (N,) tells which cars have moved before in it."""
    other = contact.moved[1] or (contact.other >= 0 and bool(moved[contact.other]))
    return replace(contact, time=contact.time + seconds, moved=(contact.moved[0] or bool(moved[contact.car]), other))
