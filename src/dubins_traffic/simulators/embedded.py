"""The embedded simulator: exact arcs, exact contacts, batches; the reference of the conformance suite."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np

from dubins_traffic.cars.body import DUBINS
from dubins_traffic.cars.clip_and_move import rows
from dubins_traffic.cars.motion import Meeting, Motion, enlarged, step, workspace
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.calls import bound
from dubins_traffic.protocols import Capabilities
from dubins_traffic.simulators.modelled import ModelledCars

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


ABSENT = 1e9
"""Least distance of places without a car, metres: they are so far away, and apart, that no bodies meet there."""


class Embedded:
    """Moves every car on the exact arc of its command and finds every contact of the interval in order of time.

    The order of events is that of `docs/semantics.md`; the method is in `kernels.boxes` and `cars.motion`. Cars of
    another model than the Dubins car are moved by `simulators.modelled`, one trial at a time.
    """

    capabilities = Capabilities(batched=True, deterministic=True, lockstep=True, forks=True)

    def reset(self, instances: Sequence[Instance], grain: int = 1) -> State:
        """Place the cars of a batch of instances, which share one control rate.

        Each trial has as many places for cars as the largest one needs, rounded up to a multiple of `grain`.
        """
        rates = {instance.problem.rate for instance in instances}
        if len(rates) != 1:
            raise InputError("a batch has one control rate", field="rate", value=sorted(rates), expected="one")
        self._rate = rates.pop()
        counts = [len(instance.starts) for instance in instances]
        places = -(-max(counts) // grain) * grain
        state = State.zeros(len(instances), places)
        state.count[:] = counts
        state.x[:] = ABSENT * np.arange(1, places + 1)
        present = np.arange(places) < state.count[:, None]
        poses = chain.from_iterable(instance.starts for instance in instances)
        starts = np.array(list(chain.from_iterable(poses)), dtype=np.float64).reshape(-1, 4)
        for k, array in enumerate((state.x, state.y, state.c, state.s)):
            array[present] = starts[:, k]
        self.state = state
        cars = pack_cars([instance.problem.car for instance in instances])
        self.motion = Motion(
            state=state,
            obstacles=pack_obstacles([instance.problem.obstacles for instance in instances]),
            cars=cars,
            rows=rows(cars, places, 1.0 / self._rate),
            work=workspace(len(instances), places),
        )
        self._none: list[tuple[Contact, ...]] = [()] * len(instances)
        self._tick = 0
        self._move = bound(step)
        self._modelled = self._models(instances)
        return state

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip `commands` (B, N, 2) in place, move for one tick and return the contacts of each trial."""
        if not (commands.dtype == np.float64 and commands.flags.carray):
            copied = np.array(commands, dtype=np.float64, order="C")
            met = self.step(copied)
            commands[...] = copied
            return met
        trials = len(self._none)
        contacts: list[tuple[Contact, ...]] = self._none
        self._tick += 1
        if self._modelled is not None:
            return [self._modelled.step(commands, lambda row: contact_of(row, self._tick, self._rate))]
        done = 0
        while done < trials:
            reached = self._move(done, 1.0 / self._rate, commands, self.motion)
            if self.motion.work.found[0]:
                contacts = self._collect(contacts)
            done = -1 - reached if reached < 0 else reached
            if reached < 0:
                self.motion = self.motion.replace(work=enlarged(self.motion.work))
        return contacts

    def close(self) -> None:
        """Do nothing: there are no resources but memory."""

    def _models(self, instances: Sequence[Instance]) -> ModelledCars | None:
        """Return the `Modelled` that moves cars of another model, None for Dubins cars; it takes a single trial."""
        others = [instance.problem.car.model for instance in instances if instance.problem.car.model != DUBINS]
        if not others:
            return None
        if len(instances) > 1:
            raise InputError("trials with a car model run by themselves", field="car.model", value=others[0])
        return ModelledCars(instances[0], self.motion)

    def _collect(self, contacts: list[tuple[Contact, ...]]) -> list[tuple[Contact, ...]]:
        contacts = list(contacts)
        for row in self.motion.work.meetings():
            contacts[row.b] += (contact_of(row, self._tick, self._rate),)
        return contacts


def contact_of(row: Meeting, tick: int, rate: float) -> Contact:
    """Return a row of `Workspace.contact` as a Contact in the tick that ends in frame `tick`."""
    return Contact(
        tick=tick,
        time=(tick - 1) / rate + row.time,
        car=row.car,
        other=row.other,
        x=row.px,
        y=row.py,
        nx=row.nx,
        ny=row.ny,
        closing=(row.closing, row.other_closing),
        moved=(row.moved != 0, row.other_moved != 0),
    )
