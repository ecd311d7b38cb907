"""Over ROS 1: what a lockstep tick costs beside a bare rospy ping-pong, and how even real time is.

Needs Debian's ROS packages (scripts/system-packages.sh). A master and the peers run as processes of their own.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Condition
from time import monotonic, perf_counter, sleep
from typing import Any

import numpy as np

import dubins_traffic as dt
from benchmarks.table import Row
from dubins_traffic.protocols import Clock, View
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sessions.plan import rehearse
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.link import Link
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.messages import MissingRosError, load, write_python
from dubins_traffic.transports.ros1.node import join, leave
from dubins_traffic.transports.ros1.transport import COMMANDS, Ros1

PEER = Path(__file__).parent / "ros1_peer.py"
STATES = "/gazebo/model_states"
ROUNDS = 2000
SECONDS = 60.0
CONFIG: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4]},
    "duration": ROUNDS / 30.0,
    "number_trials": 1,
}


class _Timed(Ros1):
    """Notes when it was given each frame of a running trial."""

    def __init__(self, uri: str) -> None:
        super().__init__(uri)
        self.times: list[float] = []

    def frame(self, view: View) -> None:
        """Note the time, then publish."""
        if view.running and view.tick > 0:
            self.times.append(perf_counter())
        super().frame(view)


class _Steady:
    """What the peer does, in this process."""

    def start(self, problem: dt.Problem) -> None:
        """Nothing is needed of the problem."""

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        """Return what the peer sends."""
        return 0.3, 0.1 + 0.0 * observation.tick


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    try:
        load()
    except MissingRosError as error:
        return [Row("over ROS 1", f"not measured: {error}", "none", met=True)]
    instance = _instance(2, ROUNDS / 30.0)
    rehearse(instance)
    with TemporaryDirectory() as folder:
        messages = Path(folder) / "messages"
        write_python(messages)
        os.environ.update(ROS_LOG_DIR=folder, ROS_IP="127.0.0.1")
        master = Master()
        try:
            environment = {**os.environ, "ROS_MASTER_URI": master.uri, "PYTHONPATH": str(messages)}
            return [*_lockstep(master.uri, instance, environment), *_real_time(master.uri, environment)]
        finally:
            leave()
            master.close()


def _lockstep(uri: str, instance: dt.Instance, environment: dict[str, str]) -> list[Row]:
    bare = _ping_pong(uri, len(instance.names), environment)
    ticks = np.diff(_trial(uri, instance, Lockstep(), environment)[0])
    began = perf_counter()
    run_trial(instance, _Steady())
    here = (perf_counter() - began) / instance.ticks
    again = _ping_pong(uri, len(instance.names), environment)
    bare = (bare + again) / 2
    added = float(np.median(ticks)) - here
    figure = f"{added * 1e6:.0f} us beside {bare * 1e6:.0f} us, {added / bare:.2f}x"
    return [Row("added by a lockstep tick over ROS 1, bare ping-pong", figure, "<= 1.5x", added <= 1.5 * bare)]


def _real_time(uri: str, environment: dict[str, str]) -> list[Row]:
    times, answered, seconds = _trial(uri, _instance(11, SECONDS), RealTime(), environment)
    off = float(np.percentile(abs(np.diff(times) - 1 / 30), 99))
    bare = _sleeps()
    rate = answered / seconds
    met = off <= max(0.002, 1.5 * bare)
    figure = f"{off * 1e3:.2f} ms; a bare sleep loop {bare * 1e3:.2f} ms"
    return [
        Row("period of 30 Hz in real time, 12 cars, 60 s: p99 off", figure, "<= 2 ms or 1.5x", met),
        Row("model states a second that the peer got", f"{rate:.0f}", ">= 100", rate >= 100),
    ]


def _instance(others: int, seconds: float) -> dt.Instance:
    agents = [{"type": "wander", "name": "agent", "count": others}]
    return replace(dt.draw(dt.load_config({**CONFIG, "e-agents": agents}), seed=1), duration=seconds)


def _trial(
    uri: str, instance: dt.Instance, clock: Clock, environment: dict[str, str]
) -> tuple[list[float], int, float]:
    """Run a trial that a peer drives; return the times of its frames, and what the peer counted."""
    transport = _Timed(uri)
    link = Link(transport, clock)
    try:
        with _peer(STATES, COMMANDS.format("ego"), environment) as peer:
            run_trial(instance, link=link)
            peer.terminate()
            count, seconds = peer.communicate(timeout=10)[0].split()
    finally:
        link.close()
    return transport.times, int(count), float(seconds)


def _ping_pong(uri: str, cars: int, environment: dict[str, str]) -> float:
    """Return the median seconds from publishing model states to the Twist that answers, with rospy alone."""
    rospy, m = join(uri), load()
    arrived, turn = Condition(), [0]

    def take(_message: Any) -> None:
        with arrived:
            turn[0] += 1
            arrived.notify()

    ping = rospy.Publisher("/ping", m.ModelStates, queue_size=100, tcp_nodelay=True)
    pong = rospy.Subscriber("/pong", m.Twist, take, tcp_nodelay=True)
    names = [f"car{n}" for n in range(cars)]
    took: list[float] = []
    with _peer("/ping", "/pong", environment):
        while not ping.get_num_connections() or not pong.get_num_connections():
            sleep(0.01)
        for k in range(ROUNDS):
            began = perf_counter()
            states = m.ModelStates(names, [m.Pose() for _ in names], [m.Twist() for _ in names])
            with arrived:
                ping.publish(states)
                if not arrived.wait_for(lambda k=k: turn[0] > k, 5):
                    raise TimeoutError("the peer does not answer")
            took.append(perf_counter() - began)
    ping.unregister()
    pong.unregister()
    return float(np.median(took))


def _sleeps() -> float:
    """Return by how much a bare loop of sleeps at 30 Hz is off its period, at the 99th percentile of 20 s."""
    times: list[float] = []
    begin = monotonic()
    for k in range(600):
        sleep(max(0.0, begin + k / 30 - monotonic()))
        times.append(monotonic())
    return float(np.percentile(abs(np.diff(times) - 1 / 30), 99))


@contextmanager
def _peer(heard: str, said: str, environment: dict[str, str]) -> Iterator[subprocess.Popen[str]]:
    command = ["/usr/bin/python3", str(PEER), heard, said]
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate()
