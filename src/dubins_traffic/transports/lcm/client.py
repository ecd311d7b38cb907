"""The other end of `transport`: drives a car with a controller of this package's protocol, from any process."""

from __future__ import annotations

import os
from select import select
from time import monotonic
from typing import TYPE_CHECKING

from dubins_traffic.protocols import Closes, Controller
from dubins_traffic.transports.lcm import connection, encoding
from dubins_traffic.transports.lcm.dubins_traffic_lcm import (
    command_t,
    end_t,
    grant_t,
    instance_t,
    mode_t,
    state_t,
)
from dubins_traffic.transports.link import EGO_NAME

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

AGAIN = 0.5
"""Seconds between two requests for a trial."""


class Driver:
    """Drives one car through trials of a session, one after another.

    Parameters
    ----------
    controller : Controller
        Is started with each problem and asked once a tick, for the newest state that has arrived.
    url : str, optional
        As of `transport.Lcm`.
    car : str
        Which car to drive. The driver of the ego asks for trials to begin; others wait for them.
    """

    def __init__(self, controller: Controller, url: str | None = None, car: str = "ego") -> None:
        self._controller = controller
        self._car = car
        self._lcm = connection.connect(url or connection.usual_url())
        self._sender = int.from_bytes(os.urandom(7), "little")
        self._ready = False
        self._instance: instance_t | None = None
        self._state: state_t | None = None
        self._end: end_t | None = None
        for channel, take in (
            (connection.INSTANCE, self._take_instance),
            (connection.state(car), self._take_state),
            (connection.END, self._take_end),
            (connection.GRANT, self._take_grant),
        ):
            self._lcm.subscribe(channel, take)

    def drive(self, patience: float = 60.0) -> end_t:
        """Ask for a trial, drive through it and return how it ended.

        Parameters
        ----------
        patience : float
            Seconds without any message for this car after which the session counts as gone.

        Raises
        ------
        TimeoutError
            If nothing comes for so long.
        """
        instance = self._await_instance(patience)
        self._controller.start(encoding.problem_from_message(instance))
        self._drive(instance, patience)
        if isinstance(self._controller, Closes):
            self._controller.close()
        end, self._end = self._end, None
        if end is None:  # its message was lost: the next trial has begun
            return end_t()
        self._instance = None
        return end

    def _await_instance(self, patience: float) -> instance_t:
        until = monotonic() + patience
        self._state = self._end = None
        while self._instance is None:
            self._ready = False
            self._request(mode_t.READY)
            self._receive(AGAIN)
            if self._ready and self._car == EGO_NAME:
                self._request(mode_t.START)
                self._receive(AGAIN)
            if monotonic() > until:
                raise TimeoutError(f"no trial within {patience:g} s")
        return self._instance

    def _drive(self, instance: instance_t, patience: float) -> None:
        problem = encoding.problem_from_message(instance)
        answer, answered = b"", -1
        while self._end is None and self._instance is instance:
            state, self._state = self._state, None
            if state is None or state.trial != instance.trial:
                self._receive(patience)
                if self._silent:
                    raise TimeoutError(f"no message within {patience:g} s")
                continue
            if state.tick > answered:
                answer, answered = self._act(state, problem), state.tick
            self._lcm.publish(connection.command(self._car), answer)

    def _act(self, state: state_t, problem: Problem) -> bytes:
        command = self._controller.act(encoding.observation_from_message(state, problem))
        answer = command_t()
        answer.trial, answer.tick = state.trial, state.tick
        if command is None:
            answer.gives_up = True
        else:
            answer.speed, answer.yaw_rate = command
        return answer.encode()

    def _receive(self, seconds: float) -> None:
        """Wait for a message and take all that have come, so that the newest state is acted on."""
        arrived, _, _ = select([self._lcm.fileno()], [], [], seconds)
        self._silent = not arrived
        while self._lcm.handle_timeout(0) > 0:
            pass

    def _request(self, mode: int) -> None:
        request = mode_t()
        request.sender, request.mode = self._sender, mode
        self._lcm.publish(connection.MODE, request.encode())

    def _take_instance(self, _channel: str, data: bytes) -> None:
        message = instance_t.decode(data)
        if self._instance is None or self._instance.trial != message.trial:
            self._instance = message

    def _take_state(self, _channel: str, data: bytes) -> None:
        self._state = state_t.decode(data)

    def _take_end(self, _channel: str, data: bytes) -> None:
        message = end_t.decode(data)
        if self._instance is not None and message.trial == self._instance.trial:
            self._end = message

    def _take_grant(self, _channel: str, data: bytes) -> None:
        grant = grant_t.decode(data)
        if grant.sender == self._sender and grant.result and grant.mode == mode_t.READY:
            self._ready = True


def drive(controller: Controller, url: str | None = None, car: str = "ego") -> end_t:
    """Drive `car` through one trial and return how it ended; see `Driver`."""
    return Driver(controller, url, car).drive()
