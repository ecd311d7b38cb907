"""Which goal a car seeks, and how far it is to it along lanes (compiled).

A car seeks the goal of its present round that is nearest along lanes when it has visited the one before. Inside a disc
there is no lane state: from there the way leads straight to where a road leaves the disc, and on along that road.
"""

from __future__ import annotations

from math import sqrt

from dubins_traffic.cars.state import EGO
from dubins_traffic.kernels.arrays import INFINITE
from dubins_traffic.kernels.compile import jit, jit_inline
from dubins_traffic.learning.clocks import keep_time
from dubins_traffic.learning.outlook import OutlookTables
from dubins_traffic.roads.lookup import lane_direction_at, lane_end
from dubins_traffic.routing.lane_graph import foot, frame
from dubins_traffic.rules.visits import begins_visit, come_by, do_goal, finish_round


@jit_inline
def lane_of(b: int, n: int, tables: OutlookTables) -> int:
    """Return the lane of car n: its lane state, else that of the nearest segment that leads along its heading."""
    lane: int = tables.labels.lane[b, n]
    if lane >= 0:
        return lane
    segment: int = tables.labels.segment[b, n]
    x, y = tables.state.x[b, n], tables.state.y[b, n]
    tx, ty = lane_direction_at(tables.roads, tables.trial[b].net, 2 * segment, x, y)
    ahead = tables.state.c[b, n] * tx + tables.state.s[b, n] * ty
    return 2 * segment + (0 if ahead >= 0.0 else 1)


@jit
def metres_to_goal(b: int, n: int, row: int, tables: OutlookTables) -> float:
    """Return the distance along lanes from car n to the goal in `row` (row) of `tables.goal`, metres; inf: no way."""
    roads, goal = tables.roads, tables.goal[row]
    net = tables.trial[b].net
    at: int = tables.labels.at[b, n]
    x, y = tables.state.x[b, n], tables.state.y[b, n]
    if at >= 0:
        return _out_of_disc(b, at, x, y, row, tables)
    lane = lane_of(b, n, tables)
    along, _, _, _, length = foot(roads, net, lane, x, y)
    return tables.metres[goal.route, lane] - min(max(along, 0.0), length)


@jit
def _out_of_disc(b: int, at: int, x: float, y: float, row: int, tables: OutlookTables) -> float:
    """Return the metres from (x, y) in the disc of `at` to a goal: straight to where a road leaves, and along it."""
    roads, goal, trial = tables.roads, tables.goal[row], tables.trial[b]
    vertex: int = roads.vert_off[trial.net] + at
    if goal.vertex == at and goal.fresh != 0:
        dx, dy = x - roads.vertex[vertex].x, y - roads.vertex[vertex].y
        return sqrt(dx * dx + dy * dy)
    least = INFINITE
    for k in range(roads.degree[vertex]):
        lane: int = roads.arms[vertex, k]
        ax, ay, tx, ty, length = frame(roads, trial.net, lane)
        out = min(trial.radius, 0.5 * length)
        dx, dy = ax + out * tx - x, ay + out * ty - y
        least = min(least, sqrt(dx * dx + dy * dy) + tables.metres[goal.route, lane] - out)
    return least


@jit
def next_lane(b: int, n: int, row: int, tables: OutlookTables) -> int:
    """Return the lane by which car n leaves the crossing ahead on the way to a goal; -1 at the goal, or without a way.

    `row` (row) is the goal's in `tables.goal`. The car does not turn round but at dead ends; inside a disc it may.
    """
    roads, goal = tables.roads, tables.goal[row]
    net = tables.trial[b].net
    at: int = tables.labels.at[b, n]
    lane = -1 if at >= 0 else lane_of(b, n, tables)
    v = at if at >= 0 else lane_end(roads, net, lane)
    vertex: int = roads.vert_off[net] + v
    if v == goal.vertex and goal.fresh != 0:
        return -1
    best = -1
    least = INFINITE
    for k in range(roads.degree[vertex]):
        other: int = roads.arms[vertex, k]
        back = lane >= 0 and other == lane ^ 1 and roads.degree[vertex] > 1
        metres = tables.metres[goal.route, other]
        if not back and metres < least:
            best = other
            least = metres
    return best


@jit
def look(b: int, tables: OutlookTables) -> int:
    """Keep the time of trial b, and `seek` its goals; return how many are visited. Call it once per labelled frame."""
    keep_time(b, tables.clock[b], tables.state, tables.labels)
    return seek(b, tables)


@jit_inline
def seek(b: int, tables: OutlookTables) -> int:
    """Note the goals that the ego of trial b visits in a labelled frame; return how many.

    If it has visited the goal that it seeks, or seeks none, it seeks the nearest goal of its round from here on.
    """
    trial = tables.trial[b]
    at: int = tables.labels.at[b, EGO]
    if at == trial.last_at and trial.target >= 0:
        return 0
    visited = 0
    if at >= 0 and at != trial.last_at:
        visited = _come_into(b, at, tables)
        trial.last_at = at
    if trial.target < 0 or tables.done[trial.target] != 0 or visited != 0:
        _choose(b, tables)
    return visited


@jit
def _come_into(b: int, at: int, tables: OutlookTables) -> int:
    """Note that the ego has come into the disc of `at`; return the number of goals that it visits thereby."""
    trial = tables.trial[b]
    visited = 0
    for row in range(trial.first_goal, trial.last_goal):
        goal = tables.goal[row]
        come_by(at, goal)
        if begins_visit(goal.vertex == at, goal):
            visited += 1
            do_goal(row, tables.done, trial)
    trial.visits += visited
    if visited != 0:
        finish_round(trial.first_goal, trial.last_goal, tables.done, trial)
    return visited


@jit
def _choose(b: int, tables: OutlookTables) -> None:
    """Let the ego seek the goal of its round that is nearest along lanes, the first of equally near ones."""
    trial = tables.trial[b]
    trial.target = -1
    least = INFINITE
    for row in range(trial.first_goal, trial.last_goal):
        if tables.done[row] == 0:
            metres = metres_to_goal(b, EGO, row, tables)
            if trial.target < 0 or metres < least:
                trial.target = row
                least = metres
