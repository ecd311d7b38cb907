"""The simulator `gazebo`: cars with wheels, inertia and contact forces, stepped in lockstep."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path
from time import monotonic, sleep
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.cars.clip_and_move import clip, rows
from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.errors import InputError, PeerError
from dubins_traffic.gazebo.link import BODY, CONTACT, Contacts, LostError, MessageKind
from dubins_traffic.gazebo.prefix import find
from dubins_traffic.gazebo.server import Server
from dubins_traffic.gazebo.world import BUMPER, Drive, outlook, world
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.protocols import Capabilities, End

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

STEP: Final = 0.005
"""The longest step of the physics, seconds; a tick is a whole number of equal steps."""


class Gazebo:
    """Gazebo 11 as a simulator, with a new server for each trial.

    Parameters
    ----------
    prefix : path, optional
        Of the installation; by default that of ``dubins-traffic gazebo install``.
    step : float
        The longest step of the physics, seconds.
    port : int, optional
        Loopback port by which a gzclient finds the server; by default a free one.
    patience : float
        Seconds within which the server must answer.
    show : bool
        Whether each trial is shown by a gzclient, at the pace of the clock, with its roads.

    Raises
    ------
    InputError
        If Gazebo is not installed, or is to be shown where there is no display.

    Notes
    -----
    The server is told the rates of the wheels and nothing else; where the cars are is what the physics says. A server
    that dies or does not answer ends its trial as `world_lost`, after frame 0 at the starts if it does so while it
    starts. Equal trials are equal to the last bit on one
    machine and installation, since each has a server of its own.
    """

    capabilities = Capabilities(batched=False, deterministic=True, lockstep=True)

    def __init__(
        self,
        prefix: str | Path | None = None,
        *,
        step: float = STEP,
        port: int | None = None,
        patience: float = 10.0,
        show: bool = False,
    ) -> None:
        self._installation = find(prefix)
        if show and not os.environ.get("DISPLAY"):
            raise InputError("no display to show Gazebo on", file="DISPLAY", expected="a display, or no --gui")
        self._show = show
        self._longest = step
        self._port = port
        self._patience = patience
        self.server: Server | None = None
        self._lost = ""

    def reset(self, instances: Sequence[Instance]) -> State:
        """Start a server with the world of the only instance given, and place its cars.

        Raises
        ------
        InputError
            If there are several instances, or the server can't be started: no trial could be run here.
        """
        if len(instances) != 1:
            raise InputError("Gazebo runs no batch", field="instances", value=len(instances), expected="one")
        self.close()
        (instance,) = instances
        problem = instance.problem
        require_dubins(problem.car, "Gazebo has a car")
        cars = len(instance.starts)
        self._rate = problem.rate
        self._steps = math.ceil(1.0 / (problem.rate * self._longest) - 1e-9)
        step = 1.0 / (problem.rate * self._steps)
        plugin = str(self._installation.plugin)
        scenery = outlook(problem.network) if self._show else ()
        text = world(instance.starts, problem.car.body, problem.obstacles, step, plugin, scenery)
        self._lost = ""
        self._drive = Drive.below(problem.car.body)
        self._rows = rows(pack_cars([problem.car]), cars, 1.0 / problem.rate)
        self._asked = np.zeros((2, cars))
        self._message = np.zeros(1 + 2 * cars)
        self._message[0] = self._steps
        self._contacts = Contacts(instance, step)
        self._tick = 0
        self.state = State.zeros(1, cars)
        for array, column in zip(self.state, zip(*instance.starts, strict=True), strict=False):
            array[0] = column
        try:
            self.server = Server(self._installation, text, port=self._port, patience=self._patience)
            if self._show:
                self.server.show(self._installation)
                self._began = monotonic()
            self._take(self._ask(MessageKind.STATE))
        except LostError as error:
            self._lost = str(error)
        except PeerError as error:
            self._lost = error.detail
        return self.state

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip `commands` (1, N, 2) in place, turn the wheels for one tick and return the contacts of the trial.

        Raises
        ------
        PeerError
            If the server has died or does not answer; it is ended then.
        """
        speed, yaw_rate = self._asked
        clip(self._rows, 0, commands[0], speed, yaw_rate, 0, len(speed))
        self._message[1::2], self._message[2::2] = self._drive.wheels(speed, yaw_rate)
        answer = self._ask(MessageKind.STEP, self._message)
        self._tick += 1
        if self._show:
            sleep(max(0.0, self._began + self._tick / self._rate - monotonic()))
        contacts = self._take(answer)
        return [self._contacts.collect(self._tick, contacts, self.state)]

    def scan(self, car: int, rays: Floats, longest: float) -> Floats:
        """Return how far the rays (R, 2), unit vectors in the frame of `car`, go: (R,), at most `longest` metres."""
        message = np.concatenate(([car, BUMPER, longest], rays.ravel()))
        try:
            return self._ask(MessageKind.SCAN, message).copy()
        except PeerError:
            if self._tick:
                raise
            return np.full(len(rays), longest)  # a world that is only shown: the trial's first step names its end

    def close(self) -> None:
        """End the server."""
        if self.server is not None:
            self.server.close()
            self.server = None

    def _take(self, answer: Floats) -> Floats:
        """Read the state of all cars; return the contacts (K, CONTACT)."""
        cars = self.state.x.shape[1]
        x, y, c, s, vx, vy, yaw_rate = answer[: BODY * cars].reshape(cars, BODY).T
        state = self.state
        state.x[0], state.y[0], state.c[0], state.s[0], state.yaw_rate[0] = x, y, c, s, yaw_rate
        state.speed[0] = vx * c + vy * s
        return answer[BODY * cars :].reshape(-1, CONTACT)

    def _ask(self, kind: MessageKind, values: Floats | None = None) -> Floats:
        if self._lost:
            raise PeerError(End.WORLD_LOST.value, self._lost)
        if self.server is None:
            raise InputError("the simulator is closed", expected="`reset` before `step`")
        try:
            return self.server.ask(kind, values)
        except LostError as error:
            self._lost = self.server.explain(error)
            self.close()
            raise PeerError(End.WORLD_LOST.value, self._lost) from None
