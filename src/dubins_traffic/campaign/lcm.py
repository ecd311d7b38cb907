"""A session over LCM."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from dubins_traffic.campaign.sessions import Programme
from dubins_traffic.campaign.single import Result
from dubins_traffic.protocols import Clock
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.lcm.transport import Lcm
from dubins_traffic.transports.link import Link, Patience
from dubins_traffic.transports.maestro import Maestro


@dataclass(frozen=True, slots=True)
class Terms:
    """How a session meets its drivers.

    Parameters
    ----------
    url : str, optional
        An LCM URL; by default that of ``LCM_DEFAULT_URL``, else multicast within this machine.
    wait : bool
        Whether a trial begins when a program asks START; else it begins at once.
    lockstep : bool
        Whether the simulation waits for a command of every remote car each tick; else it runs in real time.
    factor : float
        How many times as fast as the wall clock, in real time.
    deadline : float
        Seconds within which a command must come in lockstep.
    patience : Patience
        How long peers are waited for otherwise.
    """

    url: str | None = None
    wait: bool = False
    lockstep: bool = False
    factor: float = 1.0
    deadline: float = 5.0
    patience: Patience = field(default_factory=Patience)


def run_over_lcm(programme: Programme, terms: Terms) -> Iterator[Result]:
    """Run the trials of `programme` and yield their results; leave nothing behind however it ends.

    Raises
    ------
    TransportError
        If there is no route for multicast, or another session at the same URL.
    MissingExtraError
        If the extra `lcm` is not installed.
    InputError
        If the URL is none of LCM, or an instance can't be drawn.
    """
    clock: Clock = Lockstep(terms.deadline) if terms.lockstep else RealTime(terms.factor)
    maestro = Maestro() if terms.wait else None
    transport = Lcm(terms.url, maestro)
    try:
        link = Link(transport, clock, ego=programme.controller is None, patience=terms.patience)
        yield from programme.run(link, maestro)
    finally:
        transport.close()
