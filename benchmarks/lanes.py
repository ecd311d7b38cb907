"""How `lanes` drives: random instances alone and among wandering cars, against free flow.

    python -m benchmarks.lanes [INSTANCES] [JOBS]

Each instance is a random network of 6 to 60 intersections (anything from a tree to as many segments as a grid has),
1 to 4 goals and 1 to 8 e-agents of the kind `wander`. It is run without e-agents for ten free-flow rounds, and with
them for 120 s. Free flow is that of `dubins_traffic.driving.free_flow`. "Stood while free" is the longest time for
which the ego stood although, all the while, nobody was within 1.5 m ahead in its lane and, if it was within 2 m of its
lane's end, nobody's body met the disc of the intersection there (for an ego inside a disc: nobody else met that disc).
"""

from __future__ import annotations

import math
import statistics
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dubins_traffic.campaign.single import run_trial
from dubins_traffic.driving.free_flow import free_flow
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.protocols import Ending
from dubins_traffic.record.sink import Frames

ROUNDS = 10
DURATION = 120.0
LANE_AHEAD = 1.5
LOOK = 2.0


@dataclass(frozen=True, slots=True)
class Row:
    """One instance: what `lanes` did alone (rounds, seconds off the road) and among others."""

    number: int
    intersections: int
    agents: int
    rounds: int
    free_rounds: int
    off_road: float
    at_fault: int
    collisions: int
    distance: float
    stood_free: float


class StandingWhileFree:
    """Measures the longest time for which the ego stood though the way ahead was free."""

    def begin(self, instance: Instance) -> None:
        self._problem = instance.problem
        self._longest = 0
        self._run = 0
        self._rate = instance.problem.rate

    def frames(self, frames: Frames) -> None:
        for f in range(len(frames)):
            x, y = frames.x[f], frames.y[f]
            stands = abs(frames.speed[f, 0]) < 0.05
            if stands and way_is_free(self._problem, x, y, float(frames.c[f, 0]), float(frames.s[f, 0])):
                self._run += 1
                self._longest = max(self._longest, self._run)
            else:
                self._run = 0

    def end(self, ending: Ending) -> None:
        self._seconds = self._longest / self._rate

    def result(self) -> float:
        return self._seconds


def way_is_free(problem: Problem, x: Any, y: Any, c: float, s: float) -> bool:
    """Whether lane and intersection ahead of car 0 are free of others; arrays (N,) of centres, heading of car 0."""
    network, w, reach = problem.network, problem.car.w, problem.car.body.reach
    ego = np.array((x[0], y[0]))
    others = np.stack([x[1:], y[1:]], axis=-1)
    segment = int(network.nearest_segment(ego)[0])
    tx, ty = network.tangents[segment].tolist()
    lane = 2 * segment + (0 if c * tx + s * ty >= 0.0 else 1)
    radius = problem.intersection_radius
    end = network.lane_ends(lane)[1]
    own, _ = network.lane_coordinates(lane, ego)
    there, left = network.lane_coordinates(lane, others)
    ahead = (
        (there > own) & (there - own < LANE_AHEAD + reach) & (left - reach < 0.0) & (left + reach > -2.0 * w)
    )
    if ahead.any():
        return False
    vertices = [end] if float(network.lengths[segment] - own) < radius + reach + LOOK else []
    nearest, far = network.nearest_intersection(ego)
    if float(far) < radius + reach:
        vertices.append(int(nearest))
    for v in vertices:
        vx, vy = network.points[v].tolist()
        if (np.hypot(x[1:] - vx, y[1:] - vy) < radius + reach).any():
            return False
    return True


def instance(number: int, seed: int = 2016) -> Instance:
    """Return the random instance of a number."""
    draws = Draws(seed, number, 900)
    intersections = draws.between(6, 60)
    most = math.floor(2 * intersections - 2 * math.sqrt(intersections))
    configuration = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {
            "random": {
                "intersections": intersections,
                "segments": draws.between(intersections - 1, int(0.5 * (intersections + most))),
                "rigid_motion": True,
            }
        },
        "e-agents": [{"type": "wander", "name": "agent", "count": draws.between(1, 8)}],
        "number_trials": 1,
        "duration": int(DURATION),
        "number_goals_bounds": [1, 4],
    }
    return draw(load_config(configuration), seed, number)


def measure(number: int) -> Row:
    """Run `lanes` on an instance, alone and among others."""
    whole = instance(number)
    flow = free_flow(whole)
    duration = math.ceil(flow.arrivals[0][0] / flow.speed + ROUNDS * flow.round_time)
    problem = replace(whole.problem, e_agents=())
    alone = replace(whole, problem=problem, e_agents=(), starts=whole.starts[:1], duration=float(duration))
    first = run_trial(alone, "lanes").score
    watch = StandingWhileFree()
    second = run_trial(whole, "lanes", sinks=[watch]).score
    faults = [collision for collision in second.collisions if collision.at_fault]
    return Row(
        number,
        len(problem.network.intersections),
        len(whole.e_agents),
        first.rounds,
        flow.rounds(duration),
        first.driven.off_road_s + second.driven.off_road_s,
        len(faults) + len(first.collisions),
        len(second.collisions),
        second.driven.distance_m / flow.distance(whole.duration),
        watch.result(),
    )


def table(rows: Sequence[Row]) -> str:
    """Return the bar's table."""
    share = [row.rounds / row.free_rounds for row in rows]
    lines = [
        ("seconds off the road, all instances", f"{sum(row.off_road for row in rows):.3f}", "0"),
        ("collisions at fault, all instances", str(sum(row.at_fault for row in rows)), "0"),
        ("alone: rounds per free-flow round, least", f"{min(share):.3f}", ">= 0.9"),
        ("alone: rounds per free-flow round, median", f"{statistics.median(share):.3f}", ""),
        (
            "among others: distance per free-flow distance, median",
            f"{statistics.median(row.distance for row in rows):.3f}",
            ">= 0.5",
        ),
        ("among others: the same, least", f"{min(row.distance for row in rows):.3f}", ""),
        ("stood while free, longest, seconds", f"{max(row.stood_free for row in rows):.1f}", "< 10"),
    ]
    return "\n".join(f"{name:<56}{value:>10}   {bar}" for name, value, bar in lines)


def main() -> None:
    """Print the table."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    jobs = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    with ProcessPoolExecutor(jobs) as pool:
        rows = list(pool.map(measure, range(first, first + count)))
    for row in rows:
        if row.off_road or row.at_fault or row.rounds < 0.9 * row.free_rounds or row.stood_free >= 10.0:
            print(row)
    for row in sorted(rows, key=lambda row: row.distance)[:12]:
        print(f"least distance: {row}")
    print(f"lanes on {count} random instances")
    print(table(rows))


if __name__ == "__main__":
    main()
