"""A session over ROS 2, by DDS."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from dubins_traffic.errors import needs
from dubins_traffic.runs.single import Result
from dubins_traffic.sessions.outside import Outside
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.transports.external import ExternalWorld
    from dubins_traffic.transports.ros2.transport import Ros2

WORLD = "ros2-world"


def make_transport(
    domain: int | None,
    maestro: Maestro | None,
    *,
    here: bool = True,
    clock: bool = False,
    simulated: bool = True,
    markers: bool = False,
    foreign: ForeignMaestro | None = None,
) -> Ros2:
    """Return the transport; MissingExtraError if the extra `ros2` is not installed."""
    with needs("ROS 2", "ros2"):
        from dubins_traffic.transports.ros2.transport import Ros2
    return Ros2(domain, maestro=maestro, here=here, clock=clock, simulated=simulated, markers=markers, foreign=foreign)


def run_over_ros2(
    session_plan: SessionPlan,
    pace: Pace,
    *,
    domain: int | None = None,
    wide: bool = False,
    elsewhere: bool = False,
    clock: bool = False,
    markers: bool = False,
    simulator: str | None = None,
    poses: str | None = None,
    delay: float | None = None,
    noise: float | None = None,
    loss: float | None = None,
) -> Iterator[Result]:
    """Run the trials of `session_plan` and yield their results; leave nothing behind however it ends.

    Parameters
    ----------
    domain : int, optional
        Number of the DDS domain; by default that of ``ROS_DOMAIN_ID``, else 0.
    wide : bool
        Whether messages may leave this machine.
    elsewhere : bool
        Whether another process is the maestro: it tells problems, and starts and ends trials.
    clock : bool
        Whether `/clock` is published, and messages are stamped with simulated time.
    markers : bool
        Whether markers of roads, goals and cars are published, which RViz shows.
    simulator, poses, delay, noise, loss : optional
        What moves the cars, as `sessions.outside.Outside` has it; ``ros2-world``: they are somewhere in the domain, in
        real time.

    Raises
    ------
    TransportError
        If there can be no participant in the domain.
    MissingExtraError
        If the extra `ros2` is not installed.
    InputError
        If ``ROS_DOMAIN_ID`` is no domain, or an instance can't be drawn.
    """
    outside = Outside(WORLD, simulator, poses, delay, noise, loss)
    session_plan = outside.planned(session_plan, pace, clock=clock, elsewhere=elsewhere)
    maestro = Maestro() if session_plan.controller is None and not elsewhere else None
    foreign = ForeignMaestro() if elsewhere else None
    transport = make_transport(
        domain, maestro, here=not wide, clock=clock, simulated=not outside, markers=markers, foreign=foreign
    )
    where = f"DDS domain {transport.domain}{'' if wide else ', within this machine'}"
    session_plan = session_plan.claim(transport.name)
    session_plan.rehearse()

    def make() -> tuple[ExternalWorld, Callable[[Instance], Instance]]:
        from dubins_traffic.transports.ros2.external import Ros2Wire

        return outside.made(Ros2Wire(transport.graph, poses), session_plan)

    yield from session_plan.run(transport, pace, maestro, make if outside else None, at=lambda: where, foreign=foreign)
