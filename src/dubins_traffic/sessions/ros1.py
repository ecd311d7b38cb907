"""A session over ROS 1: its master, its node, its clock, its end."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack

from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.outside import Outside
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro
from dubins_traffic.transports.ros1.external import Ros1Wire
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.node import leave
from dubins_traffic.transports.ros1.transport import Ros1, SessionParameters

DEFAULT_URI = "http://localhost:11311/"
WORLD = "ros1-world"


def run_over_ros1(
    session_plan: SessionPlan,
    pace: Pace,
    *,
    master: bool = False,
    port: int = 11311,
    elsewhere: bool = False,
    clock: bool = False,
    simulator: str | None = None,
    poses: str | None = None,
    delay: float | None = None,
    noise: float | None = None,
    loss: float | None = None,
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    master : bool
        Whether a master is started on the loopback interface; else the one of ``ROS_MASTER_URI`` is joined.
    port : int
        Of that master, 0 for any.
    elsewhere : bool
        Whether another process is the maestro, such as that of 2016: it tells problems, and starts and ends trials.
    clock : bool
        Whether `/clock` is published.
    simulator : str, optional
        What moves the cars, whatever the source says; ``ros1-world``: they are somewhere in the graph, in real time.
    poses : str, optional
        Of such a world: the topic of each car's pose, ``{}`` in place of its name.
    delay, noise : float, optional
        Of such a world: how late commands take effect, seconds, and how far poses are off at most, metres; by default
        both are measured before the first trial.
    loss : float, optional
        Of such a world: the share of commands that may get lost, by default `transports.tracked.LOSS`.

    Raises
    ------
    TransportError
        If there is no master, the port is in use, there is a maestro already, or the master goes away.
    MissingRosError
        If Debian's ROS packages are not installed.
    InputError
        If an instance can't be drawn.
    """
    outside = Outside(WORLD, simulator, poses, delay, noise, loss)
    session_plan = outside.planned(session_plan, pace, clock=clock, elsewhere=elsewhere)
    maestro = Maestro() if session_plan.controller is None and not elsewhere else None
    foreign = ForeignMaestro() if elsewhere else None
    session_plan = session_plan.claim(Ros1.name)
    session_plan.rehearse()
    with ExitStack() as stack:
        uri = os.environ.get("ROS_MASTER_URI", DEFAULT_URI)
        if master:
            started = Master(port)
            stack.callback(started.close)
            os.environ["ROS_IP"] = "127.0.0.1"
            uri = started.uri
        session_plan.say(f"ROS master at {uri}")
        stack.callback(leave)
        transport = Ros1(
            uri,
            maestro=maestro,
            parameters=_parameters(session_plan),
            clock=clock,
            simulated=not outside,
            foreign=foreign,
        )
        make = (lambda: outside.made(Ros1Wire(transport.rospy, poses), session_plan)) if outside else None
        yield from session_plan.run(transport, pace, maestro, make, foreign=foreign)


def _parameters(session_plan: SessionPlan) -> SessionParameters:
    settings = None if session_plan.configuration is None else session_plan.configuration.settings
    return SessionParameters(
        number_trials=session_plan.trials,
        duration_bounds=None if settings is None else settings.duration_bounds,
        number_goals_bounds=None if settings is None else settings.number_goals_bounds,
        results_file=None if session_plan.data is None else str(session_plan.data.absolute()),
    )
