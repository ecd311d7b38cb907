"""A session over ROS 1: its master, its node, its clock, its end."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.runs.plan import check_simulator
from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.plan import Pace, SessionPlan, moved_by
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro
from dubins_traffic.transports.ros1.external import NAME as WORLD
from dubins_traffic.transports.ros1.external import ExternalWorld
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.node import leave
from dubins_traffic.transports.ros1.transport import Ros1, SessionParameters
from dubins_traffic.transports.tracked import Measured

DEFAULT_URI = "http://localhost:11311/"


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

    Raises
    ------
    TransportError
        If there is no master, the port is in use, there is a maestro already, or the master goes away.
    MissingRosError
        If Debian's ROS packages are not installed.
    InputError
        If an instance can't be drawn.
    """
    world = simulator == WORLD
    for option, value in (("--poses", poses), ("--delay", delay), ("--noise", noise)):
        if value is not None and not world:
            raise InputError("is of another world", file=option, value=value, expected=f"--simulator {WORLD}")
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
    simulated = session_plan
    if simulator is not None:
        session_plan = replace(session_plan, supply=partial(moved_by, session_plan.supply, simulator))
    if not world:
        if simulator is not None:
            check_simulator("--simulator", simulator)
        simulated = session_plan
    session_plan = session_plan.claim(Ros1.name)
    simulated.rehearse()
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
            simulated=not world,
            foreign=foreign,
        )
        if not world:
            yield from session_plan.run(transport, pace, maestro, foreign=foreign)
            return
        make = partial(_elsewhere, transport, ego, poses, session_plan.say, delay, noise)
        yield from session_plan.run(transport, pace, maestro, make, foreign=foreign)


def _elsewhere(
    transport: Ros1, ego: bool, poses: str | None, say: Callable[[str], None], delay: float | None,
    noise: float | None,
) -> tuple[ExternalWorld, Callable[[Instance], Instance]]:  # fmt: skip
    """Return the world outside, and what describes its disturbances: it is measured before the first trial."""
    world = ExternalWorld(transport.rospy, ego=ego, poses=poses, say=say)
    known: list[Measured] = []

    def described(instance: Instance) -> Instance:
        problem, is_first = instance.problem, not known
        if is_first:
            known.append(world.measure(instance))
        declared = known[0].disturbances(problem, delay, noise)
        if is_first:
            say(known[0].told(problem, declared))
        return replace(instance, disturbances=declared)

    return world, described


def _parameters(session_plan: SessionPlan) -> SessionParameters:
    settings = None if session_plan.configuration is None else session_plan.configuration.settings
    return SessionParameters(
        number_trials=session_plan.trials,
        duration_bounds=None if settings is None else settings.duration_bounds,
        number_goals_bounds=None if settings is None else settings.number_goals_bounds,
        results_file=None if session_plan.data is None else str(session_plan.data.absolute()),
    )
