"""A session over ROS 1: its master, its node, its clock, its end."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial

from dubins_traffic.campaign.sessions import Programme, moved_by, rehearse
from dubins_traffic.campaign.single import Result
from dubins_traffic.errors import InputError
from dubins_traffic.protocols import Clock
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.link import Link, Patience
from dubins_traffic.transports.maestro import Maestro
from dubins_traffic.transports.ros1.desk import Told
from dubins_traffic.transports.ros1.external import NAME as WORLD
from dubins_traffic.transports.ros1.external import ExternalWorld
from dubins_traffic.transports.ros1.master import Master
from dubins_traffic.transports.ros1.node import leave
from dubins_traffic.transports.ros1.transport import Ros1

DEFAULT_URI = "http://localhost:11311/"


@dataclass(frozen=True, slots=True)
class Terms:
    """How a session meets the ROS graph.

    Parameters
    ----------
    master : int, optional
        Port of a master to start on the loopback interface, 0 for any; None: join the one of ``ROS_MASTER_URI``.
    lockstep : bool
        Whether the simulation waits for a command of every remote car each tick; else it runs in real time.
    factor : float
        How many times as fast as the wall clock, in real time.
    deadline : float
        Seconds within which a command must come in lockstep.
    patience : Patience
        How long peers are waited for otherwise.
    clock : bool
        Whether `/clock` is published.
    world : bool
        Whether the cars are not simulated here but somewhere in the graph, in real time.
    poses : str, optional
        Of such a world: the topic of each car's pose, ``{}`` in place of its name.
    """

    master: int | None = None
    lockstep: bool = False
    factor: float = 1.0
    deadline: float = 5.0
    patience: Patience = field(default_factory=Patience)
    clock: bool = False
    world: bool = False
    poses: str | None = None


def run_over_ros1(programme: Programme, terms: Terms) -> Iterator[Result]:
    """Run the trials of `programme` and yield their results; leave nothing behind however it ends.

    Raises
    ------
    TransportError
        If there is no master, the port is in use, there is a maestro already, or the master goes away.
    MissingRosError
        If Debian's ROS packages are not installed.
    InputError
        If an instance can't be drawn.
    """
    if terms.world and (terms.lockstep or terms.clock or terms.factor != 1.0):
        expected = "neither --lockstep nor --clock nor --factor"
        raise InputError("a world outside has its own time", file="--simulator", expected=expected)
    clock: Clock = Lockstep(terms.deadline) if terms.lockstep else RealTime(terms.factor)
    maestro = Maestro() if programme.controller is None else None
    rehearse(programme.supply(0))
    with ExitStack() as stack:
        if terms.master is not None:
            master = Master(terms.master)
            stack.callback(master.close)
            os.environ["ROS_IP"] = "127.0.0.1"
            uri = master.uri
        else:
            uri = os.environ.get("ROS_MASTER_URI", DEFAULT_URI)
        stack.callback(leave)
        transport = Ros1(
            uri, maestro=maestro, told=_told(programme), clock=terms.clock, simulated=not terms.world
        )
        stack.callback(transport.close)
        link = Link(transport, clock, ego=programme.controller is None, patience=terms.patience)
        simulator = None
        if terms.world:
            ego = programme.controller is None
            simulator = ExternalWorld(transport.rospy, ego=ego, poses=terms.poses)
            programme = replace(programme, supply=partial(moved_by, programme.supply, WORLD))
        yield from programme.run(link, maestro, simulator)


def _told(programme: Programme) -> Told:
    settings = None if programme.configuration is None else programme.configuration.settings
    return Told(
        number_trials=programme.trials,
        duration_bounds=None if settings is None else settings.duration_bounds,
        number_goals_bounds=None if settings is None else settings.number_goals_bounds,
        results_file=None if programme.data is None else str(programme.data.absolute()),
    )
