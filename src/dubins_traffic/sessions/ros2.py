"""A session over ROS 2, by DDS."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from dubins_traffic.errors import needs
from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.maestro import Maestro

if TYPE_CHECKING:
    from dubins_traffic.transports.ros2.transport import Ros2


def make_transport(
    domain: int | None, maestro: Maestro | None, *, here: bool = True, clock: bool = False
) -> Ros2:
    """Return the transport; MissingExtraError if the extra `ros2` is not installed."""
    with needs("ROS 2", "ros2"):
        from dubins_traffic.transports.ros2.transport import Ros2
    return Ros2(domain, maestro=maestro, here=here, clock=clock)


def run_over_ros2(
    session_plan: SessionPlan,
    pace: Pace,
    *,
    domain: int | None = None,
    wide: bool = False,
    clock: bool = False,
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    domain : int, optional
        Number of the DDS domain; by default that of ``ROS_DOMAIN_ID``, else 0.
    wide : bool
        Whether messages may leave this machine.
    clock : bool
        Whether `/clock` is published, and messages are stamped with simulated time.

    Raises
    ------
    TransportError
        If there can be no participant in the domain.
    MissingExtraError
        If the extra `ros2` is not installed.
    InputError
        If ``ROS_DOMAIN_ID`` is no domain, or an instance can't be drawn.
    """
    maestro = Maestro() if session_plan.controller is None else None
    transport = make_transport(domain, maestro, here=not wide, clock=clock)
    where = f"DDS domain {transport.domain}{'' if wide else ', within this machine'}"
    yield from session_plan.over(transport, pace, maestro, at=lambda: where)
