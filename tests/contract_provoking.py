"""Scenes in which an ego tries to bring `lawful` cars to a breach (`tests.contract_scenes`)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from dubins_traffic.cars.body import Body, Disc
from dubins_traffic.cars.state import Pose
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.protocols import Controller
from tests import contract_drivers as drivers
from tests.contract_stages import BODIES, ELBOW, RADIUS, TEE, Made, Placed, Scene, Stage


def _provoked(
    stage: Stage,
    lane: int,
    ego: Pose,
    driver: Controller,
    more: int = 3,
    rules: Mapping[str, float] | None = None,
) -> Made:
    """Return the trial of an ego at a place that is about a lane, among lawful cars that come there."""
    agents: Placed = []
    others = list(range(stage.network.lanes))
    stage.dice.shuffle(others)
    bodies = [ego]
    for own in [lane, *others]:
        for s in (0.5 * stage.length(own), 0.5 * stage.length(own) - 0.9):
            place = stage.pose(own, s)
            clear = RADIUS + stage.reach < s < stage.length(own) - RADIUS - stage.reach
            barred = any(math.dist((o.x, o.y), place[:2]) < 0.7 + stage.reach for o in stage.obstacles)
            if (
                len(agents) < more
                and clear
                and not barred
                and all(math.dist(place[:2], o[:2]) > 2.0 * stage.reach + 0.4 for o in bodies)
            ):
                agents.append(("lawful", {}, place))
                bodies.append(place)
    goals = tuple(range(len(stage.network.intersections)))[:3]
    return stage.instance(ego, agents, goals, 150.0, rules or {}), driver


def _bend_stage(number: int, body: Body | None = None) -> tuple[Stage, int, int]:
    """Return a stage, a lane into a bend, and the lane out of it."""
    stage = Stage(number, None if number % 3 == 0 else ELBOW, body=body)
    lane = stage.lane_into(2)
    return stage, lane, stage.exit_of(lane)


def ego_beyond_exit(number: int) -> Made:
    """The ego stands a little beyond a disc."""
    stage, lane, out = _bend_stage(number)
    far = RADIUS + stage.dice.uniform(0.3, 1.1)
    return _provoked(stage, lane, stage.pose(out, far), drivers.AsEgo(drivers.Stands()))


def ego_beyond_crossing(number: int) -> Made:
    """The ego stands a little beyond a crossing, many cars about."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    place = stage.pose(stage.exit_of(lane), RADIUS + stage.dice.uniform(0.3, 1.1))
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Stands()), 6)


def ego_closes(number: int) -> Made:
    """The ego closes an exit by backing, and opens it again."""
    stage, lane, out = _bend_stage(number)
    own = {"back": stage.dice.uniform(0.05, 0.29), "period": stage.dice.uniform(2.0, 20.0)}
    far = RADIUS + own["back"] + stage.dice.uniform(0.3, 1.1)
    return _provoked(stage, lane, stage.pose(out, far), drivers.AsEgo(drivers.Swings(), **own))


def ego_closes_crossing(number: int) -> Made:
    """The ego closes an exit of a crossing by backing, and opens it again, many cars about."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    own = {"back": stage.dice.uniform(0.05, 0.29), "period": stage.dice.uniform(2.0, 20.0)}
    far = RADIUS + own["back"] + stage.dice.uniform(0.3, 1.1)
    return _provoked(stage, lane, stage.pose(stage.exit_of(lane), far), drivers.AsEgo(drivers.Swings(), **own), 6)


def ego_tilted(number: int) -> Made:
    """The ego stands tilted at the centre line beside a bend."""
    stage, lane, out = _bend_stage(number)
    out = stage.dice.choice((out, lane))
    s = stage.dice.uniform(0.2, 0.9) + RADIUS
    place = stage.pose(out, s if out != lane else stage.length(lane) - s, -0.3, stage.dice.uniform(-1.6, 1.6))
    half = place.c, place.s
    side = stage.pose(out, 0.0)
    across = abs(half[1] * side.c - half[0] * side.s), abs(half[0] * side.c + half[1] * side.s)
    extent = stage.reach if isinstance(stage.body, Disc) else (
        0.5 * (stage.body.length * across[0] + stage.body.width * across[1])
    )  # fmt: skip
    lateral = 0.04 - extent
    return _provoked(
        stage, lane, Pose(*stage.pose(out, s if out != lane else stage.length(lane) - s, lateral)[:2], *half),
        drivers.AsEgo(drivers.Stands()),
    )  # fmt: skip


def ego_beside_line(number: int) -> Made:
    """The ego stands in the other lane beside the line of a crossing, as far over the centre line as it may."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    half = stage.body.radius if isinstance(stage.body, Disc) else 0.5 * stage.body.width
    far = RADIUS + stage.reach + stage.dice.uniform(-0.1, 0.3)
    place = stage.pose(lane ^ 1, far, stage.dice.uniform(0.0, 0.049) - half)
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Stands()))


def ego_slow(number: int) -> Made:
    """The ego keeps the law at a crawl."""
    stage, lane, _ = _bend_stage(number)
    own = {"speed": stage.dice.choice((0.03, 0.06, 0.12))}
    return _provoked(stage, lane, stage.pose(lane, 0.6 * stage.length(lane)), drivers.AsEgo(drivers.Slow(), **own))


def ego_swings(number: int) -> Made:
    """The ego swings in its lane, before a crossing or a bend, at the head of a queue."""
    stage = Stage(number, (TEE, ELBOW)[number // 3 % 2])
    lane = stage.lane_into((3, 2)[number // 3 % 2])
    back = stage.dice.uniform(0.02, 0.29)
    place = stage.pose(lane, stage.length(lane) - RADIUS - stage.reach - stage.dice.uniform(0.01, 0.5))
    own = {"back": back, "period": stage.dice.uniform(1.0, 12.0)}
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Swings(), **own), 4)


def ego_at_edge(number: int) -> Made:
    """The ego goes to and fro over the edge of a bend's disc."""
    stage, lane, out = _bend_stage(number)
    own = {"back": stage.dice.uniform(0.2, 0.29), "period": stage.dice.uniform(1.0, 16.0)}
    into = stage.dice.random() < 0.5
    s = RADIUS + stage.dice.uniform(-0.1, 0.29 + stage.reach)
    place = stage.pose(lane, stage.length(lane) - s) if into else stage.pose(out, s)
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Swings(), **own))


def ego_in_bend(number: int) -> Made:
    """The ego stands in a bend for ever."""
    stage, lane, out = _bend_stage(number)
    place = stage.pose(out, stage.dice.uniform(0.0, 1.1), stage.dice.uniform(-0.3, 0.3), stage.dice.uniform(-3.0, 3.0))
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Stands()))


def ego_presses(number: int, body: Body = BODIES[0]) -> Made:
    """The ego comes into a bend after others, stands as close to one as it may, and stays with it; all are discs."""
    stage, lane, out = _bend_stage(number, body)
    far = RADIUS + stage.reach + stage.dice.uniform(0.02, 0.5)
    own = stage.dice.choice((lane, out ^ 1))
    side = stage.dice.choice((-1.0, 1.0)) * stage.dice.uniform(1.3, 3.1)
    inner = drivers.AsEgo(drivers.Presses(), side=side, gap=stage.dice.uniform(0.005, 0.1))
    return _provoked(stage, lane, stage.pose(own, stage.length(own) - far), Shield(inner))


def ego_presses_boxes(number: int) -> Made:
    """Do as `ego_presses`, where all are rectangles."""
    return ego_presses(number, BODIES[1 + number // 2 % 2])


def ego_by_obstacle(number: int) -> Made:
    """The ego stands beside an obstacle, so that nobody passes it."""
    stage = Stage(number, (ELBOW, None)[number // 3 % 2])
    lane = stage.dice.randrange(stage.network.lanes)
    s = stage.dice.uniform(RADIUS + 0.4, stage.length(lane) - RADIUS - 0.4)
    stage.block(lane, s, stage.dice.uniform(-0.4, -0.2), stage.dice.uniform(0.08, 0.15))
    place = stage.pose(lane ^ 1, stage.length(lane) - s + stage.dice.uniform(-0.6, 0.6))
    back = stage.dice.choice((0.0, 0.29))
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Swings(), back=back))


def ego_faces(number: int) -> Made:
    """The ego drives up to who passes an obstacle on the left, and stands before it; a queue may be behind that."""
    stage = Stage(number, ELBOW if number % 3 else None)
    lane = stage.dice.randrange(stage.network.lanes)
    length = stage.length(lane)
    s = stage.dice.uniform(RADIUS + 1.0, length - RADIUS - 0.4)
    stage.block(lane, s, stage.dice.uniform(-0.4, -0.2), stage.dice.uniform(0.08, 0.2))
    ego = stage.pose(lane ^ 1, max(0.2, length - s - stage.dice.uniform(0.8, 2.5)))
    own = {"near": stage.dice.uniform(0.8, 3.0), "gap": stage.dice.uniform(0.02, 0.9)}
    inner = drivers.AsEgo(drivers.Faces(), **own, speed=0.7, minds=True)
    return _provoked(stage, lane, ego, Shield(inner), stage.dice.choice((2, 3, 4, 5)))


def ego_beyond_obstacle(number: int) -> Made:
    """The ego stands before the disc toward which others pass an obstacle that is near to it."""
    stage = Stage(number, (ELBOW, None)[number // 3 % 2])
    lanes = [lane for lane in range(stage.network.lanes) if stage.length(lane) > 3.9]
    lane = stage.dice.choice(lanes or list(range(stage.network.lanes)))
    long = 0.0 if isinstance(stage.body, Disc) else stage.body.length
    radius = stage.dice.uniform(0.08, 0.15)
    s = stage.length(lane) - RADIUS - long - stage.dice.uniform(0.69, 1.0) - radius
    stage.block(lane, max(s, RADIUS + 0.85 + radius), radius=radius)
    others = [own for own in stage.network.arms(stage.end(lane)) if own != lane ^ 1]
    own = stage.dice.choice(others) ^ 1 if others else lane ^ 1
    far = RADIUS + stage.reach + stage.dice.uniform(0.1, 1.0)
    place = stage.pose(own, stage.length(own) - far if others else far)
    return _provoked(stage, lane, place, drivers.AsEgo(drivers.Stands()), 2)


def ego_holds(number: int) -> Made:
    """The ego keeps the law, but holds at every crossing."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    hold = stage.dice.choice((2.9, 3.1, 30.0, 1e9))
    return _provoked(
        stage, lane, stage.pose(lane, 0.6 * stage.length(lane)), drivers.AsEgo(drivers.Holds(), hold=hold), 4
    )


def ego_whims(number: int) -> Made:
    """The ego does anything under the shield."""
    stage = Stage(number, (None, ELBOW, TEE)[number // 3 % 3])
    lane = stage.dice.randrange(stage.network.lanes)
    inner = drivers.AsEgo(drivers.Whims(), seed=number)
    return _provoked(stage, lane, stage.pose(lane, 0.5 * stage.length(lane)), Shield(inner), 4)


PROVOKING: Final[Mapping[str, Scene]] = {
    own.__name__: own
    for own in (
        ego_beyond_exit, ego_beyond_crossing, ego_closes, ego_closes_crossing, ego_tilted, ego_beside_line, ego_slow,
        ego_swings, ego_at_edge, ego_in_bend, ego_presses, ego_by_obstacle, ego_faces,
        ego_beyond_obstacle, ego_holds, ego_whims,
    )
}  # fmt: skip
UNCLAIMED: Final[Mapping[str, Scene]] = {"ego_presses_boxes": ego_presses_boxes}
"""Scenes of which it is measured, not claimed, that no lawful car breaks a rule (docs/theory.md#on-the-road)."""
