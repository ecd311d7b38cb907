"""What a tick costs more in lockstep over LCM, beside bare exchanges of the same messages with the same process."""

from __future__ import annotations

import multiprocessing
import socket
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from lcm import LCM

from benchmarks.table import Row
from dubins_traffic.cars.state import Observation
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Mailbox, View
from dubins_traffic.runs.single import run_trial
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.lcm import connection
from dubins_traffic.transports.lcm.dubins_traffic_lcm import command_t, state_t
from dubins_traffic.transports.lcm.transport import Lcm
from dubins_traffic.transports.link import Link

TURNS = 5
"""Trials and exchanges are measured in turn, so that whatever the machine does meanwhile meets both."""
TICKS = 600
MOST = 1.5


def answer(url: str, began: Any) -> None:
    """Answer every state with a command, as quickly as can be."""
    lcm = LCM(url)

    def reply(channel: str, data: bytes) -> None:
        state = state_t.decode(data)
        command = command_t()
        command.trial, command.tick, command.speed = state.trial, state.tick, 0.4
        lcm.publish(channel.replace("STATE", "COMMAND"), command.encode())

    lcm.subscribe("TRAFFIC_STATE_.*", reply)
    began.set()
    while True:
        lcm.handle()


class Noting(Lcm):
    """Notes when each frame goes out."""

    def open(self, mailbox: Mailbox) -> None:
        """Begin with no notes."""
        self.times: list[float] = []
        self.sent: dict[str, bytes] = {}
        super().open(mailbox)

    def frame(self, view: View) -> None:
        """Note the time."""
        if view.running and view.tick > 0:
            self.times.append(perf_counter())
        super().frame(view)

    def _publish(self, channel: str, message: bytes) -> None:
        self.sent[channel] = message
        super()._publish(channel, message)


class Bare:
    """Drives in process, and in every tick makes the exchange of messages that a session makes, with bare LCM.

    That is: encode a state, send it and a world, which nobody answers; there decode it, encode a command, send it;
    here decode that. Between ticks, unlike in a tight loop, caches and sleeping processors are those of a session.
    """

    def __init__(self, url: str, sent: dict[str, bytes]) -> None:
        self.exchanges: list[float] = []
        self.rests: list[float] = []
        self._ended = 0.0
        self._lcm = LCM(url)
        self._state = state_t.decode(sent[connection.state("ego")])
        self._world = sent[connection.WORLD]
        self._arrived = False
        self._lcm.subscribe(connection.command("ping"), self._take)

    def start(self, problem: object) -> None:
        """Nothing to prepare."""

    def act(self, observation: Observation) -> tuple[float, float]:  # noqa: ARG002
        """Drive straight on, once an exchange is done."""
        began = perf_counter()
        self.rests.append(began - self._ended)
        self._arrived = False
        self._lcm.publish(connection.state("ping"), self._state.encode())
        self._lcm.publish(connection.WORLD, self._world)
        while not self._arrived:
            self._lcm.handle()
        self._ended = perf_counter()
        self.exchanges.append(self._ended - began)
        return 0.4, 0.0

    def _take(self, _channel: str, data: bytes) -> None:
        self._arrived = command_t.decode(data).speed > 0.0


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        url = f"udpm://{connection.DEFAULT_GROUP}:{probe.getsockname()[1]}?ttl=0"
    context = multiprocessing.get_context("spawn")
    began = context.Event()
    peer = context.Process(target=answer, args=(url, began), daemon=True)
    peer.start()
    began.wait(60)
    try:
        return [_compare(url, "demo"), _compare(url, "town")]
    finally:
        peer.kill()
        peer.join()


def _compare(url: str, name: str) -> Row:
    instance = draw(load_config(name), 1, 0)
    instance = replace(instance, duration=TICKS / instance.problem.rate)
    bare: list[float] = []
    rests: list[float] = []
    over: list[float] = []
    for _ in range(TURNS):
        transport, times = run_over(url, instance)
        over += times
        exchanging = Bare(url, transport.sent)
        run_trial(instance, exchanging)
        bare += exchanging.exchanges
        rests += exchanging.rests
    exchange = float(np.median(bare))
    added = float(np.median(over)) - float(np.median(rests))
    ratio = added / exchange
    figure = f"{added * 1e6:.0f} us added to {np.median(rests) * 1e6:.0f} us: {ratio:.2f} of {exchange * 1e6:.0f} us"
    what = f"lockstep over LCM, {len(instance.starts)} cars, beside bare exchanges between ticks"
    return Row(what, figure, f"<= {MOST}", ratio <= MOST)


def run_over(url: str, instance: Instance) -> tuple[Noting, list[float]]:
    """Run a trial over LCM; return its transport and the seconds that each tick took."""
    transport = Noting(url)
    link = Link(transport, Lockstep(5.0))
    try:
        result = run_trial(instance, link=link)
    finally:
        link.close()
    assert result.ending.ticks == TICKS, result.ending
    return transport, np.diff(transport.times).tolist()
