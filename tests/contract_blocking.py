"""Scenes in which e-agents try to block the ego `rules` (`tests.contract_scenes`)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from dubins_traffic.cars.state import Pose
from tests.contract_stages import ELBOW, RADIUS, RING, SOON, TEE, Made, Placed, Scene, Stage


def _blocked(stage: Stage, lane: int, agents: Placed, rules: Mapping[str, float] = SOON) -> Made:
    """Return the trial in which `rules` comes to a lane, between whose ends are its goals."""
    network = stage.network
    free = [
        own
        for own in range(network.lanes)
        if own >> 1 != lane >> 1
        and all(math.dist(stage.pose(own, 0.5 * stage.length(own))[:2], at[2][:2]) > 1.0 for at in agents)
    ]
    before = [own for own in free if stage.end(own) in (stage.end(lane ^ 1), stage.end(lane))]
    first = stage.dice.choice(before or free)
    ego = stage.pose(first, 0.5 * stage.length(first))
    goals = (stage.end(lane), stage.end(lane ^ 1))
    return stage.instance(ego, agents, goals, 150.0, rules), "rules"


def _any_stage(number: int) -> tuple[Stage, int]:
    """Return an elbow, whose middle road is the only way, or a grid; and a lane between two bends or crossings."""
    stage = Stage(number, ELBOW if number % 3 else None)
    middle = number % 3 and number % 5 != 4
    return stage, stage.dice.choice((2, 3)) if middle else stage.dice.randrange(stage.network.lanes)


def passed(number: int) -> Made:
    """Two cars that have passed each other back up in turns."""
    stage, lane = _any_stage(number)
    middle, apart = 0.5 * stage.length(lane), stage.dice.uniform(0.1, 0.6)
    back = stage.dice.choice((0.29, 0.31, 0.1, 0.02))
    own = {"back": back, "period": 8.0}
    return _blocked(stage, lane, [
        ("Swings", own, stage.pose(lane, middle + apart)),
        ("Swings", {**own, "after": 4.0}, stage.pose(lane ^ 1, middle + apart)),
    ])  # fmt: skip


def abreast(number: int) -> Made:
    """Two cars stand or swing side by side, one in each lane."""
    stage, lane = _any_stage(number)
    middle = 0.5 * stage.length(lane)
    back = stage.dice.choice((0.0, 0.2, 0.29, 0.31))
    return _blocked(stage, lane, [
        ("Swings", {"back": back}, stage.pose(lane, middle)),
        ("Swings", {"back": back, "after": 4.0}, stage.pose(lane ^ 1, middle)),
    ])  # fmt: skip


def disc_edge_out(number: int) -> Made:
    """A car goes to and fro over the edge of a disc, out of which it comes."""
    stage, lane = _any_stage(number)
    back = stage.dice.uniform(0.25, 0.7)
    start = RADIUS + stage.dice.uniform(0.0, back)
    return _blocked(stage, lane, [("Swings", {"back": back}, stage.pose(lane, start))])


def disc_edge_in(number: int) -> Made:
    """A car goes to and fro over the edge of the bend's disc to which it drives."""
    stage, lane = _any_stage(number)
    ahead = stage.dice.uniform(0.25, 0.7)
    start = stage.length(lane) - RADIUS - stage.dice.uniform(0.0, 1.0) * ahead
    return _blocked(stage, lane, [("Swings", {"back": -ahead}, stage.pose(lane, start))])


def both_edges(number: int) -> Made:
    """Two cars go to and fro over the edges of the two discs of a road."""
    stage, lane = _any_stage(number)
    back = stage.dice.uniform(0.25, 0.7)
    own = {"back": back, "period": stage.dice.uniform(4.0, 16.0)}
    start = RADIUS + stage.dice.uniform(0.0, back)
    return _blocked(stage, lane, [
        ("Swings", own, stage.pose(lane, start)), ("Swings", own, stage.pose(lane ^ 1, start)),
    ])  # fmt: skip


def beside_obstacle(number: int) -> Made:
    """A car swings beside an obstacle."""
    stage, lane = _any_stage(number)
    stage.block(lane, 0.5 * stage.length(lane), radius=stage.dice.uniform(0.1, 0.2))
    back = stage.dice.choice((0.0, 0.29, 0.31))
    return _blocked(stage, lane, [("Swings", {"back": back}, stage.pose(lane ^ 1, 0.5 * stage.length(lane) + 0.1))])


def before_obstacle(number: int) -> Made:
    """A car swings in its own lane before an obstacle."""
    stage, lane = _any_stage(number)
    stage.block(lane, 0.5 * stage.length(lane) + 0.3, radius=stage.dice.uniform(0.1, 0.2))
    back = stage.dice.choice((0.0, 0.1, 0.2))
    place = stage.pose(lane, 0.5 * stage.length(lane) + 0.3 - 0.21 - stage.reach - stage.dice.uniform(0.0, 0.5))
    return _blocked(stage, lane, [("Swings", {"back": back}, place)])


def out_before_obstacle(number: int) -> Made:
    """A car stands with its centre just out of a crossing, on a lane that an obstacle narrows."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3) ^ 1
    out = RADIUS + stage.dice.uniform(0.01, 0.9) * stage.reach
    radius = stage.dice.uniform(0.1, 0.15)
    stage.block(lane, out + 1.05 * stage.reach + radius, radius=radius)
    back = stage.dice.choice((0.0, 0.05))
    return _blocked(stage, lane, [("Swings", {"back": back}, stage.pose(lane, out))])


def head_on(number: int) -> Made:
    """A car on the left beside an obstacle, and one that comes toward it, stand before each other."""
    stage, lane = _any_stage(number)
    middle = 0.5 * stage.length(lane)
    stage.block(lane, middle, lateral=-0.4, radius=0.15)
    apart = 2.0 * stage.reach + stage.dice.uniform(0.05, 0.3)
    swing = stage.dice.choice((0.0, 0.04))
    return _blocked(stage, lane, [
        ("Swings", {"back": swing, "period": 1.6}, stage.pose(lane, middle - 0.5 * apart, 0.2)),
        ("Swings", {"back": swing, "period": 2.0}, stage.pose(lane ^ 1, middle - 0.5 * apart)),
    ])  # fmt: skip


def face_to_face(number: int) -> Made:
    """A car that is left before an obstacle drives up to the ego, and stands before it."""
    stage, lane = _any_stage(number)
    middle, dice = 0.5 * stage.length(lane), stage.dice
    stage.block(lane, middle, lateral=-0.4, radius=0.15)
    own = {"near": dice.uniform(1.0, 3.0), "gap": dice.uniform(0.02, 0.3), "speed": dice.uniform(0.1, 0.7)}
    place = stage.pose(lane, middle - dice.uniform(0.2, 1.0) - stage.reach, dice.uniform(0.0, 0.3))
    return _blocked(stage, lane, [("Faces", own, place)])


def before_queue(number: int) -> Made:
    """A car swings before the line of a crossing, so that tickets come and go."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    line = stage.length(lane) - RADIUS - stage.reach
    back = stage.dice.uniform(0.02, 0.7)
    place = stage.pose(lane, line - stage.dice.uniform(0.02, 0.4))
    return _blocked(stage, lane, [("Swings", {"back": back, "period": stage.dice.uniform(2.0, 12.0)}, place)])


def shuttle(number: int) -> Made:
    """Two cars shuttle between two bends, and turn round in their discs."""
    stage = Stage(number, ELBOW if number % 3 else RING, fixed=True)
    lane = stage.dice.choice((2, 3))
    wait = stage.dice.choice((0.0, 2.0, 4.5))
    inside = stage.dice.uniform(0.2, 0.7)
    ends = [(own, s) for own in (lane, lane ^ 1) for s in (RADIUS - inside, stage.length(lane) - RADIUS + inside)]
    points = [(*stage.pose(own, s)[:2], wait * (k % 2)) for k, (own, s) in enumerate(ends)]
    own = {"gap": stage.dice.choice((0.3, 0.8)), "speed": stage.dice.choice((0.2, 0.7))}
    return _blocked(stage, lane, [
        ("Tours", {**own, "points": points[1:] + points[:1]}, stage.pose(lane, 0.5 * stage.length(lane))),
        ("Tours", {**own, "points": points[3:] + points[:3]}, stage.pose(lane ^ 1, 0.5 * stage.length(lane))),
    ])  # fmt: skip


def ring(number: int) -> Made:
    """Cars stand round a ring of bends, so near that each waits for the next one."""
    stage = Stage(number, RING, fixed=True)
    both = stage.dice.random() < 0.7
    free = stage.length(0) - 2.0 * RADIUS
    count = 1 + int(max(0.0, free - 0.81) / 1.4)
    places = [RADIUS + 0.7 + 1.4 * k if free > 1.4 else RADIUS + 0.5 * free for k in range(count)]
    lanes = [0, 2, 4, 6] + [1, 3, 5, 7] * both
    agents: Placed = [("Stands", {}, stage.pose(lane, s)) for lane in lanes for s in places]
    ego = stage.pose(0, 0.0, 0.0, stage.dice.uniform(-3.0, 3.0))
    own = stage.instance(ego, agents, (stage.end(0), stage.end(4)), 150.0, SOON)
    return own, "rules"


def crawler(number: int) -> Made:
    """A car keeps the law at a crawl."""
    stage, lane = _any_stage(number)
    own = {"speed": stage.dice.choice((0.02, 0.06, 0.1))}
    return _blocked(stage, lane, [("Slow", own, stage.pose(lane, 0.5 * stage.length(lane)))])


def spinner(number: int) -> Made:
    """A car turns on the spot in its lane, to and fro."""
    stage, lane = _any_stage(number)
    place = stage.pose(lane, 0.5 * stage.length(lane), -0.3)
    own = {"angle": stage.dice.uniform(0.3, 3.0), "rate": stage.dice.uniform(0.1, 2.0)}
    return _blocked(stage, lane, [("Spins", own, place)])


def in_a_disc(number: int) -> Made:
    """A car stands in a disc from the start."""
    stage, lane = _any_stage(number)
    place = stage.pose(lane, stage.dice.uniform(0.0, 1.1), stage.dice.uniform(-0.3, 0.3))
    return _blocked(stage, lane, [("Swings", {"back": stage.dice.choice((0.0, 0.1))}, place)])


def in_the_way(number: int) -> Made:
    """A car ahead of the ego, or one that comes toward it, bars its way in a bend once the ego is in there too."""
    stage = Stage(number, RING, fixed=True)
    lane = stage.dice.choice((0, 1))
    comes = stage.dice.random() < 0.5
    own = {"speed": stage.dice.uniform(0.3, 0.6), "cuts": comes}
    half = 0.5 * stage.length(lane)
    after = stage.exit_of(lane)
    agent = stage.pose(after ^ 1, half) if comes else stage.pose(lane, half + stage.dice.uniform(0.7, 0.9))
    goals = (stage.end(lane ^ 1), stage.end(after))
    return stage.instance(stage.pose(lane, half - 0.2), [("Bars", own, agent)], goals, 150.0, SOON), "rules"


def over_the_line(number: int) -> Made:
    """A car starts on the centre line or left of it, and stays there."""
    stage, lane = _any_stage(number)
    place = stage.pose(lane, 0.5 * stage.length(lane), stage.dice.uniform(-0.1, 0.4))
    return _blocked(stage, lane, [("Swings", {"back": stage.dice.choice((0.0, 0.1))}, place)])


def holder(number: int) -> Made:
    """Two cars keep the law, but hold at every crossing for nearly as long as they may."""
    stage = Stage(number, TEE)
    lane = stage.lane_into(3)
    own = {"hold": stage.dice.choice((2.9, 9.0))}
    return _blocked(stage, lane, [
        ("Holds", own, stage.pose(lane, 0.4 * stage.length(lane))),
        ("Holds", own, stage.pose(lane ^ 1, 0.5 * stage.length(lane))),
    ], {})  # fmt: skip


def any_pair(number: int) -> Made:
    """Two cars swing anywhere in a lane, any way round."""
    stage, lane = _any_stage(number)
    first = _anywhere(stage, lane, [])
    agents: Placed = []
    for place in (first, _anywhere(stage, lane, [first])):
        own = {"back": stage.dice.uniform(0.0, 0.6), "period": stage.dice.uniform(1.0, 16.0)}
        agents.append(("Swings", own, place))
    return _blocked(stage, lane, agents)


def any_tour(number: int) -> Made:
    """A car goes between random points of a lane and of the discs at its ends."""
    stage, lane = _any_stage(number)
    points = [
        (
            *stage.pose(lane, stage.dice.uniform(0.3, stage.length(lane)), stage.dice.uniform(-0.4, 0.0))[:2],
            wait,
        )
        for wait in (0.0, stage.dice.uniform(0.0, 9.0), stage.dice.uniform(0.0, 9.0))
    ]
    own = {"points": points, "speed": stage.dice.choice((0.1, 0.7))}
    return _blocked(stage, lane, [("Tours", own, _anywhere(stage, lane, []))])


def _anywhere(stage: Stage, lane: int, others: Sequence[Pose]) -> Pose:
    """Return a pose beside a lane's middle that is clear of others."""
    while True:
        s, lateral = stage.dice.uniform(1.0, stage.length(lane) - 1.0), stage.dice.uniform(-0.45, 0.45)
        place = stage.pose(lane, s, lateral, stage.dice.choice((0.0, math.pi)) + stage.dice.gauss(0.0, 0.2))
        if all(math.dist(place[:2], other[:2]) > 2.0 * stage.reach + 0.02 for other in others):
            return place


BLOCKING: Final[Mapping[str, Scene]] = {
    own.__name__: own
    for own in (
        passed, abreast, disc_edge_out, disc_edge_in, both_edges, beside_obstacle, before_obstacle,
        out_before_obstacle, head_on, face_to_face, before_queue, shuttle, ring, crawler, spinner, in_a_disc,
        in_the_way, over_the_line, holder, any_pair, any_tour,
    )
}  # fmt: skip
