"""A session over LCM."""

from __future__ import annotations

from collections.abc import Iterator

from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.lcm.connection import library
from dubins_traffic.transports.lcm.transport import Lcm
from dubins_traffic.transports.maestro import Maestro


def run_over_lcm(
    session_plan: SessionPlan, pace: Pace, *, url: str | None = None, wait: bool = False
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    url : str, optional
        An LCM URL; by default that of ``LCM_DEFAULT_URL``, else multicast within this machine.
    wait : bool
        Whether each trial waits for a message START; otherwise it begins at once.

    Raises
    ------
    TransportError
        If there is no route for multicast, or another session at the same URL.
    MissingExtraError
        If the extra `lcm` is not installed.
    InputError
        If the URL is not one of LCM, or an instance can't be drawn.
    """
    library()  # who lacks it is told before anything is compiled
    maestro = Maestro() if wait else None
    transport = Lcm(url, maestro)
    yield from session_plan.over(transport, pace, maestro, at=lambda: f"LCM at {transport.url}")
