"""A session over ROS 1: its master, its node, its clock, its end."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from dubins_traffic.errors import InputError
from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.plan import Pace, SessionPlan, moved_by
from dubins_traffic.transports.foreign import ForeignMaestro
from dubins_traffic.transports.maestro import Maestro
from dubins_traffic.transports.ros1.external import NAME as WORLD
from dubins_traffic.transports.ros1.external import ExternalWorld
from dubins_traffic.transports.ros1.maestro_services import Told
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.node import leave
from dubins_traffic.transports.ros1.transport import Ros1

DEFAULT_URI = "http://localhost:11311/"


def run_over_ros1(
    session_plan: SessionPlan,
    pace: Pace,
    *,
    master: int | None = None,
    clock: bool = False,
    world: bool = False,
    poses: str | None = None,
    elsewhere: bool = False,
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    session_plan : SessionPlan
        What is run.
    pace : Pace
        How drivers are waited for.
    master : int, optional
        Port of a master to start on the loopback interface, 0 for any; None: join the one of ``ROS_MASTER_URI``.
    clock : bool
        Whether `/clock` is published.
    world : bool
        Whether the cars are not simulated here but somewhere in the graph, in real time.
    poses : str, optional
        Of such a world: the topic of each car's pose, ``{}`` in place of its name.
    elsewhere : bool
        Whether another process is the maestro, such as that of 2016: it tells problems, and starts and ends trials.

    Raises
    ------
    TransportError
        If there is no master, the port is in use, there is a maestro already, or the master goes away.
    MissingRosError
        If Debian's ROS packages are not installed.
    InputError
        If an instance can't be drawn.
    """
    if world and (pace.lockstep or clock or pace.factor != 1.0):
        expected = "neither --lockstep nor --clock nor --factor"
        raise InputError("a world outside has its own time", file="--simulator", expected=expected)
    if elsewhere and (pace.lockstep or pace.factor != 1.0):
        expected = "neither --lockstep nor --factor"
        raise InputError("another maestro has its own time", file="--maestro-elsewhere", expected=expected)
    if elsewhere and session_plan.append:
        expected = "--overwrite, or another folder: the other maestro tells other problems"
        raise InputError("both at once", file="--maestro-elsewhere, --append", expected=expected)
    ego = session_plan.controller is None
    maestro = Maestro() if ego and not elsewhere else None
    foreign = ForeignMaestro() if elsewhere else None
    if world:
        session_plan = replace(session_plan, supply=partial(moved_by, session_plan.supply, WORLD))
    session_plan = session_plan.claim(Ros1.name)
    session_plan.rehearse()
    with ExitStack() as stack:
        uri = os.environ.get("ROS_MASTER_URI", DEFAULT_URI)
        if master is not None:
            started = Master(master)
            stack.callback(started.close)
            os.environ["ROS_IP"] = "127.0.0.1"
            uri = started.uri
        session_plan.say(f"ROS master at {uri}")
        stack.callback(leave)
        transport = Ros1(
            uri, maestro=maestro, told=_told(session_plan), clock=clock, simulated=not world, foreign=foreign
        )
        if not world:
            yield from session_plan.run(transport, pace, maestro, foreign=foreign)
            return
        make = partial(_elsewhere, transport, ego, poses)
        yield from session_plan.run(transport, pace, maestro, make, foreign=foreign)


def _elsewhere(transport: Ros1, ego: bool, poses: str | None) -> ExternalWorld:
    return ExternalWorld(transport.rospy, ego=ego, poses=poses)


def _told(session_plan: SessionPlan) -> Told:
    settings = None if session_plan.configuration is None else session_plan.configuration.settings
    return Told(
        number_trials=session_plan.trials,
        duration_bounds=None if settings is None else settings.duration_bounds,
        number_goals_bounds=None if settings is None else settings.number_goals_bounds,
        results_file=None if session_plan.data is None else str(session_plan.data.absolute()),
    )
