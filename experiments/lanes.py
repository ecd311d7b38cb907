"""How `lanes` drives: random instances alone and among wandering cars, against free flow.

    python -m experiments.lanes [INSTANCES [JOBS [FIRST]]]

Each instance is a random network of 6 to 60 intersections (anything from a tree to as many segments as a grid has),
1 to 4 goals and 1 to 8 e-agents of the kind `wander`. It is run without e-agents for ten free-flow rounds, and with
them for 120 s. Free flow is that of `experiments.free_flow`, turning round at dead ends only. "Stood while
free" is the longest time for which the ego stood although, all the while, nobody was within 1.5 m ahead in its lane
and, if it was within 2 m of its lane's end, nobody's body met the disc of the intersection there (for an ego inside a
disc: nobody else met that disc).
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
from benchmarks.table import Row, show

from dubins_traffic.kernels.philox import Draws
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.protocols import Ending
from dubins_traffic.record.sink import Frames
from dubins_traffic.runs.single import run_trial
from experiments.drawing import random_roads, random_trial
from experiments.free_flow import free_flow

ROUNDS = 10
DURATION = 120.0
LANE_AHEAD = 1.5
LOOK = 2.0


@dataclass(frozen=True, slots=True)
class Drive:
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
        """Begin a trial."""
        self._problem = instance.problem
        self._longest = 0
        self._run = 0
        self._rate = instance.problem.rate

    def frames(self, frames: Frames) -> None:
        """Look at a block of frames."""
        for f in range(len(frames)):
            x, y = frames.x[f], frames.y[f]
            stands = abs(frames.speed[f, 0]) < 0.05
            if stands and way_is_free(self._problem, x, y, float(frames.c[f, 0]), float(frames.s[f, 0])):
                self._run += 1
                self._longest = max(self._longest, self._run)
            else:
                self._run = 0

    def end(self, _: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> float:
        """Return the seconds."""
        return self._longest / self._rate


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
    ahead = (there > own) & (there - own < LANE_AHEAD + reach) & (left - reach < 0.0) & (left + reach > -2.0 * w)
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
    network = random_roads(draws, 60, 1.0)
    e_agents = [{"type": "wander", "name": "agent", "count": draws.between(1, 8)}]
    return random_trial(network, e_agents, DURATION, seed, number)


def drive(number: int, rounds: int = ROUNDS, seconds: float = DURATION) -> Drive:
    """Run `lanes` on an instance, alone for so many rounds and among others for so many seconds."""
    whole = replace(instance(number), duration=seconds)
    flow = free_flow(whole, turns=False)
    duration = math.ceil(flow.arrivals[0][0] / flow.speed + rounds * flow.round_time)
    problem = replace(whole.problem, e_agents=())
    alone = replace(whole, problem=problem, e_agents=(), starts=whole.starts[:1], duration=float(duration))
    first = run_trial(alone, "lanes").score
    watch = StandingWhileFree()
    second = run_trial(whole, "lanes", sinks=[watch]).score
    faults = [collision for collision in second.collisions if collision.at_fault]
    return Drive(
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


def bars(drives: Sequence[Drive]) -> list[Row]:
    """Return the table of the bars."""
    off_road = sum(one.off_road for one in drives)
    faults = sum(one.at_fault for one in drives)
    shares = [one.rounds / one.free_rounds for one in drives]
    distances = [one.distance for one in drives]
    distance, stood = statistics.median(distances), max(one.stood_free for one in drives)
    rounds = f"{min(shares):.3f} (median {statistics.median(shares):.3f})"
    return [
        Row("seconds off the road, all instances", f"{off_road:.3f}", "0", off_road == 0),
        Row("collisions at fault, all instances", str(faults), "0", faults == 0),
        Row("alone: least rounds per free-flow round", rounds, ">= 0.9", min(shares) >= 0.9),
        Row(
            "among others: median distance per free-flow distance",
            f"{distance:.3f} (least {min(distances):.3f})",
            ">= 0.5",
            distance >= 0.5,
        ),
        Row("longest time stood while the way was free", f"{stood:.1f} s", "< 10 s", stood < 10.0),
    ]


def drives(count: int = 200, jobs: int = 2, first: int = 0) -> list[Drive]:
    """Run `count` instances in `jobs` processes."""
    with ProcessPoolExecutor(jobs) as pool:
        return list(pool.map(drive, range(first, first + count)))


def measure() -> list[Row]:
    """Run all instances and return the table of the bars."""
    return bars(drives())


def main() -> None:
    """Print what is remarkable, and the table."""
    found = drives(*(int(argument) for argument in sys.argv[1:4]))
    for one in found:
        if one.off_road or one.at_fault or one.rounds < 0.9 * one.free_rounds or one.stood_free >= 10.0:
            print(one)
    for one in sorted(found, key=lambda one: one.distance)[:12]:
        print(f"least distance: {one}")
    show(f"lanes on {len(found)} random instances", bars(found))


if __name__ == "__main__":
    main()
