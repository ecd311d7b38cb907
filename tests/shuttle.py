"""A controller that shuttles between goals, and how many rounds it makes beside the built-in ones.

python -m tests.shuttle 40          so many trials on each grid: two goals anywhere, three goals apart
"""

from __future__ import annotations

import math
import sys
from collections import deque
from typing import Any

import numpy as np

import dubins_traffic as dt

NAME = "tests.shuttle:Shuttle+shield"


class Shuttle:
    """Drives to the goals by turns on the way of the fewest segments, turns round in any disc, looks at nobody."""

    def start(self, problem: Any) -> None:
        """Begin with the goal that is first in the document."""
        self._problem, self._network = problem, problem.network
        self._goals = list(dict.fromkeys(problem.goal_vertices))
        self._lane: int | None = None
        self._stood = 0

    def act(self, observation: Any) -> tuple[float, float]:
        """Aim at the right lane ahead; turn on the spot towards it."""
        pose, network, bounds = observation.pose, self._network, self._problem.car.bounds
        vertex, far = network.nearest_intersection((pose.x, pose.y))
        inside = float(far) < self._problem.intersection_radius - 0.5
        if self._lane is None:
            segment = int(network.nearest_segment((pose.x, pose.y))[0])
            tx, ty = network.tangents[segment].tolist()
            self._lane = 2 * segment + (0 if pose.c * tx + pose.s * ty >= 0.0 else 1)
        if inside and int(vertex) == network.lane_ends(self._lane)[1]:
            if int(vertex) == self._goals[0]:
                self._goals.append(self._goals.pop(0))
            self._lane, self._stood = self._next(int(vertex)), 0
        s, _ = network.lane_coordinates(self._lane, (pose.x, pose.y))
        places, ways = network.lane_places(
            self._lane, np.array([max(float(s) + 0.4, self._problem.intersection_radius)])
        )
        (x, y), (tx, ty), w = places[0].tolist(), ways[0].tolist(), self._problem.car.w
        error = math.atan2(y - w * tx - pose.y, x + w * ty - pose.x) - math.atan2(pose.s, pose.c)
        error = math.atan2(math.sin(error), math.cos(error))
        if self._has_to_stop(pose):
            self._stood += 1
            return 0.0, 0.0
        return (bounds.speed if abs(error) < 0.4 else 0.0), max(-bounds.yaw_rate, min(bounds.yaw_rate, 4.0 * error))

    def _has_to_stop(self, pose: Any) -> bool:
        """Tell whether the car is close before a crossing and has not stood there for a second."""
        problem, end = self._problem, self._network.lane_ends(self._lane)[1]
        x, y = self._network.points[end].tolist()
        room = math.hypot(pose.x - x, pose.y - y) - problem.intersection_radius - problem.car.body.reach
        return len(self._network.arms(end)) > 2 and 0.0 < room < 0.2 and self._stood < problem.rate

    def _next(self, vertex: int) -> int:
        """Return the first lane of a way of the fewest segments from a vertex to the next goal."""
        network, seen, queue = self._network, {vertex}, deque([(vertex, -1)])
        while queue:
            here, first = queue.popleft()
            if here == self._goals[0]:
                return first
            for lane in network.arms(here):
                end = network.lane_ends(lane)[1]
                if end not in seen:
                    seen.add(end)
                    queue.append((end, lane if first < 0 else first))
        return -1


def document(rows: int, columns: int, goals: int, apart: int) -> dict[str, Any]:
    """Return a grid as in `rules-2026`, with three lawful cars."""
    return {
        "version": 1, "problem_domain": "dubins_traffic",
        "network": {"grid": {"rows": rows, "columns": columns, "length": 6, "removed": 0.15}},
        "car": {"bounds": {"speed": 0.7, "yaw_rate": 3.0}}, "e-agents": [{"type": "lawful", "name": "car", "count": 3}],
        "duration": 240, "number_goals_bounds": [goals, goals], "goal_segments_apart": apart, "rules": True,
    }  # fmt: skip


def counted(own: dict[str, Any], controller: str, trials: int) -> int:
    """Return the counted rounds of all trials."""
    return dt.run_batch(dt.load_config(own), controller, trials=trials).sheet.counted_rounds_sum


def main() -> None:
    """Print the counted rounds of each controller."""
    trials = int(sys.argv[1])
    for goals, apart in ((2, 1), (3, 2)):
        for rows, columns in ((2, 3), (3, 3), (3, 4), (4, 5)):
            own = document(rows, columns, goals, apart)
            found = {name: counted(own, name, trials) for name in (NAME, "rules", "lanes+shield")}
            print(goals, apart, f"{rows}x{columns}", found, flush=True)


if __name__ == "__main__":
    main()
