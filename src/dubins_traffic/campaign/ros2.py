"""A session over ROS 2, by DDS."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from dubins_traffic.campaign.sessions import Programme
from dubins_traffic.campaign.single import Result
from dubins_traffic.errors import MissingExtraError
from dubins_traffic.protocols import Clock, Transport
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.link import Link, Patience
from dubins_traffic.transports.maestro import Maestro


@dataclass(frozen=True, slots=True)
class Terms:
    """How a session meets its drivers.

    Parameters
    ----------
    domain : int, optional
        Number of the DDS domain; by default that of ``ROS_DOMAIN_ID``, else 0.
    here : bool
        Whether nothing leaves this machine.
    lockstep : bool
        Whether the simulation waits for a command of every remote car each tick; else it runs in real time.
    factor : float
        How many times as fast as the wall clock, in real time.
    deadline : float
        Seconds within which a command must come in lockstep.
    patience : Patience
        How long peers are waited for otherwise.
    """

    domain: int | None = None
    here: bool = True
    lockstep: bool = False
    factor: float = 1.0
    deadline: float = 5.0
    patience: Patience = field(default_factory=Patience)


def make_transport(domain: int | None, maestro: Maestro | None, *, here: bool = True) -> Transport:
    """Return the transport.

    Raises
    ------
    MissingExtraError
        If the extra `ros2` is not installed.
    """
    try:
        from dubins_traffic.transports.ros2.transport import Ros2
    except ImportError as error:
        raise MissingExtraError("ROS 2", "ros2") from error
    return Ros2(domain, maestro=maestro, here=here)


def run_over_ros2(programme: Programme, terms: Terms) -> Iterator[Result]:
    """Run the trials of `programme` and yield their results; leave nothing behind however it ends.

    Raises
    ------
    TransportError
        If there can be no participant in the domain.
    MissingExtraError
        If the extra `ros2` is not installed.
    InputError
        If ``ROS_DOMAIN_ID`` is no domain, or an instance can't be drawn.
    """
    clock: Clock = Lockstep(terms.deadline) if terms.lockstep else RealTime(terms.factor)
    maestro = Maestro() if programme.controller is None else None
    transport = make_transport(terms.domain, maestro, here=terms.here)
    try:
        link = Link(transport, clock, ego=programme.controller is None, patience=terms.patience)
        yield from programme.run(link, maestro)
    finally:
        transport.close()
