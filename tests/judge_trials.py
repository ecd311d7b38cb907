"""Random trials before the referee and the slow reference: `python -m tests.judge_trials 500` compares so many."""

from __future__ import annotations

import random
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from multiprocessing import Pool

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle, Obstacle, PolygonObstacle, Rectangle
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from tests.chain_reference import RING as BENT_RING
from tests.chain_reference import SNAKE
from tests.judge_reference import Judge
from tests.judging import case, judged, said
from tests.rules_scripts import KITE, TURNED_STAR, Frame, on_lane, wander

GRID = RoadNetwork.grid(2, 3, 3.5)
RING = RoadNetwork.grid(2, 2, 3.2)
ROADS = (TURNED_STAR, KITE, GRID, RING)
BENT = (BENT_RING, SNAKE)
BODIES = (Car(), Car(body=Rectangle(0.5, 0.26), bounds=Bounds(yaw_rate=0.1)), Car(body=Rectangle(0.3, 0.3)))
QUICK = {
    "left_time": 2.0, "enter_time": 4.0, "exit_time": 1.5, "rest_time": 2.0, "journey_lengths": 0.2,
    "journey_start_time": 0.5, "goal_time": 4.0, "linger_time": 2.0, "shared_time": 0.5, "forfeit_time": 1.5,
}  # fmt: skip

CLAUSES = {
    "lingers", "nearer", "passes by", "narrow exit", "narrowed exit", "comes beside", "way back", "same tick", "later",
    "ego in the bend", "one in the bend", "E6 waits", "full bend", "stopped again", "E4 paused", "E4 added up",
    "left by the ego", "out before the ego", "gone out", "out before an obstacle", "alone at an obstacle",
    "not alone at an obstacle", "E5 excused for long", "E6 paused", "E3.enter", "E3.tickets", "E4", "E5", "E6",
}  # fmt: skip
"""What is to happen in some trial: rules broken, and clauses by which no rule is or time does not count."""


def random_trial(number: int, choice: Sequence[RoadNetwork] = ROADS) -> tuple[Instance, list[Frame]]:
    """Return an instance and the script of its cars, which are odd, now and then with obstacles."""
    dice = random.Random(number)
    roads = choice[number % len(choice)]
    cars = dice.choice((3, 4, 6, 7))
    found = case(roads, cars, dice.sample(roads.intersections, 2), **QUICK)
    obstacles = [_obstacle(roads, dice) for _ in range(dice.choice((0, 0, 1, 2)))]
    problem = replace(found.problem, car=dice.choice(BODIES), obstacles=tuple(obstacles))
    return replace(found, problem=problem), wander(roads, cars, 300, number, odd=True)


def _obstacle(roads: RoadNetwork, dice: random.Random) -> Obstacle:
    lane = dice.randrange(roads.lanes)
    along, aside = dice.uniform(0.9, float(roads.lengths[lane // 2]) - 0.9), dice.uniform(-0.6, 0.3)
    if dice.random() < 0.5:
        return DiscObstacle(*on_lane(roads, lane, along, aside)[:2], dice.uniform(0.05, 0.2))
    corners = ((0.0, 0.0), (0.4, -0.2), (0.3, 0.2))
    return PolygonObstacle(tuple(on_lane(roads, lane, along + s, aside + d)[:2] for s, d in corners))


def compare(number: int, choice: Sequence[RoadNetwork] = ROADS) -> Counter[str]:
    """Compare the verdicts on one trial; return how often which rule was broken and which clause spoke."""
    instance, script = random_trial(number, choice)
    found = said(judged(instance, script))
    reference = Judge(instance, script)
    expected = reference.breaches()
    assert len(found) == len(set(found)), number
    assert set(found) == expected, (number, sorted(set(found) ^ expected))
    lingering = sum(facts["lingers"] for frame in reference.past for facts in frame)
    return reference.fired + Counter(breach[0] for breach in found) + Counter(lingers=int(lingering))


def main(arguments: Sequence[str]) -> None:
    """Compare as many trials as the first argument says; on roads that bend if the second is ``bent``."""
    seen: Counter[str] = Counter()
    count = int(arguments[0])
    choice = BENT if arguments[1:] == ["bent"] else ROADS
    with Pool() as pool:
        for done, one in enumerate(pool.imap(partial(compare, choice=choice), range(count)), 1):
            seen += one
            if done % 50 == 0:
                print(f"{done} trials alike", flush=True)
    print(dict(seen.most_common()))
    assert set(seen) >= CLAUSES, CLAUSES - set(seen)


if __name__ == "__main__":
    main(sys.argv[1:])
