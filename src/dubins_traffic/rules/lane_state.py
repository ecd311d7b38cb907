"""The lane state of one car: which lane it is on, and its progress there (docs/rules.md#lane-state)."""

from __future__ import annotations

from dubins_traffic.cars.state import Pose
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.roads.lookup import distance2, lane_coordinates, lane_direction_at
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.tables import NEVER_AGAIN, CarMemory


@jit
def lane_by_heading(t: RoadTable, net: int, segment: int, pose: Pose) -> int:
    """Return the lane of `segment` that the heading follows; direction 0 if it is square to both."""
    tx, ty = lane_direction_at(t, net, 2 * segment, pose.x, pose.y)
    return 2 * segment if pose.c * tx + pose.s * ty >= 0.0 else 2 * segment + 1


@jit
def lane_away(t: RoadTable, net: int, v: int, x: float, y: float) -> int:
    """Return the lane out of vertex v whose centre line is nearest to (x, y), the lower segment on ties."""
    row = t.vert_off[net] + v
    best = -1
    nearest = 0.0
    for k in range(4):
        lane = t.arms[row, k]
        if lane >= 0:
            d2 = distance2(t, net, lane // 2, x, y)
            if best < 0 or d2 < nearest or (d2 == nearest and lane < best):
                best = lane
                nearest = d2
    return best


@jit_inline
def lane_here(
    t: RoadTable, net: int, at_before: int, lane: int, segment: int, off2: float, pose: Pose
) -> tuple[int, bool]:
    """Return the lane that a car outside the discs is on, and whether its lane state is set anew by that.

    Parameters
    ----------
    t, net
        The roads.
    at_before
        Vertex whose disc held the centre in the frame before; -1 for none.
    lane
        Lane state of the frame before (-1: none). At the start neither `at_before` nor `lane` is set.
    segment, off2
        Nearest segment, and the squared distance from it, square metres.
    pose
        Where the car is.
    """
    if at_before >= 0:
        return lane_away(t, net, at_before, pose.x, pose.y), True
    if lane < 0:
        return lane_by_heading(t, net, segment, pose), True
    half2 = t.half_width[net] * t.half_width[net]
    elsewhere = segment != lane // 2 and off2 <= half2
    if elsewhere and distance2(t, net, lane // 2, pose.x, pose.y) > half2:
        return lane_by_heading(t, net, segment, pose), True
    return lane, False


@jit_inline
def along_lane(
    t: RoadTable, net: int, lane: int, fresh: bool, reference: float, turn_back: float, pose: Pose
) -> tuple[int, float, float, bool]:
    """Return the new lane state: (lane, progress, lateral offset, whether it flipped).

    Norm: docs/rules.md#lane-state.

    Parameters
    ----------
    t, net
        The roads.
    lane, fresh
        As `lane_here` returns them.
    reference, turn_back
        Progress from which backing is measured, and how far a car backs without turning, metres.
    pose
        Where the car is.
    """
    progress, lateral = lane_coordinates(t, net, lane, pose.x, pose.y)
    if fresh or reference - progress < turn_back:
        return lane, progress, lateral, False
    lane = lane ^ 1
    progress, lateral = lane_coordinates(t, net, lane, pose.x, pose.y)
    return lane, progress, lateral, True


@jit_inline
def forget_lane(car: CarMemory) -> None:
    """Forget where in a lane a car was, which has no lane state now."""
    car.top = car.progress = car.lateral = 0.0
    car.held_top = NEVER_AGAIN


@jit_inline
def keep_tops(car: CarMemory, fresh: bool, overtakes: bool) -> None:
    """Keep the greatest progress of a car whose progress is known, and the reference by which it would turn.

    `fresh` (bool) tells whether its lane state was set or flipped in this frame, `overtakes` (bool) whether it overtook
    in the frame before. The reference is the greatest progress, but does not rise while the car overtakes.
    """
    if fresh:
        car.top = car.progress
        car.held_top = NEVER_AGAIN
        return
    if overtakes:
        car.held_top = min(car.held_top, car.top)
    car.top = max(car.top, car.progress)
    if not overtakes and car.held_top < NEVER_AGAIN:
        car.held_top = max(car.held_top, car.progress)
        if car.held_top >= car.top:
            car.held_top = NEVER_AGAIN
