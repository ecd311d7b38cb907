"""Whether a motion takes a car off the road (compiled)."""

from __future__ import annotations

from dubins_traffic.cars.state import Command, Pose
from dubins_traffic.kernels.compile import jit_inline
from dubins_traffic.policies.rules.command_cache import keeps_to_road
from dubins_traffic.policies.rules.tables import Traffic
from dubins_traffic.policies.rules.turn_arcs import ReferencePath
from dubins_traffic.policies.safety import leaves_road


@jit_inline
def strays(b: int, n: int, speed: float, yaw_rate: float, way: ReferencePath, traffic: Traffic) -> bool:
    """Tell whether a motion takes the centre off the road, or nearly."""
    state, roads, drivers = traffic.state, traffic.roads, traffic.drivers
    pose = Pose(state.x[b, n], state.y[b, n], state.c[b, n], state.s[b, n])
    if keeps_to_road(b, n, pose.x, pose.y, way, roads, drivers):
        return False
    command = Command(speed, yaw_rate)
    return leaves_road(pose, command, drivers.vehicle[b].period, roads, drivers.net[b])
