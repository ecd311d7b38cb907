"""A session over JSON lines."""

from __future__ import annotations

from collections.abc import Iterator

from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.lines import Lines


def run_over_lines(session_plan: SessionPlan, pace: Pace, *, port: int = 0) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Each trial begins when the one before is over.

    Parameters
    ----------
    port : int
        Port on the loopback interface; 0 takes any free port, which is then printed.

    Raises
    ------
    TransportError
        If the port is in use.
    InputError
        If an instance can't be drawn.
    """
    transport = Lines(port)
    yield from session_plan.over(
        transport, pace, at=lambda: f"JSON lines at {transport.address[0]}:{transport.address[1]}"
    )
