"""The driving room's laws, on random cases: turns, rounds, the last look, following."""

import heapq
import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from experiments.free_flow import free_flow
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dubins_traffic.cars.body import Bounds, Car, Rectangle
from dubins_traffic.cars.state import Command, Observation, Pose, Propositions, Twist
from dubins_traffic.controllers.lanes import Lanes
from dubins_traffic.kernels.boxes import NEVER, Box, Drive, box_contact, driven, separation
from dubins_traffic.kernels.records import table
from dubins_traffic.kernels.trig import advance, sincos
from dubins_traffic.policies.lanes.turns import IMPOSSIBLE, VISIT, Site, along, shape
from dubins_traffic.policies.rules.tables import Vehicle
from dubins_traffic.policies.safety import motion_is_safe, slides_on
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.routing.rounds import round_time
from dubins_traffic.routing.tours import LaneGraph, Round, find_round

CARS = [
    Car(),
    Car(bounds=Bounds(turning_radius=0.2)),
    Car(bounds=Bounds(turning_radius=0.5, speed_min=0.1)),
    Car(body=Rectangle(0.5, 0.3), bounds=Bounds(turning_radius=0.8)),
    Car(w=0.2, bounds=Bounds(yaw_rate=0.9)),
]
PLAIN = settings(max_examples=200, deadline=None, derandomize=True)
BENT = RoadNetwork(
    ((0, 0, 1, 0), (1, 0, 2, 1), (1, 0, 1, 2), (1, 2, 0, 2), (0, 2, 0, 0), (2, 1, 1, 2)),
    3.0,
    (1.0, -2.0, 0.4),
    (3, 3),
)


def problem(network: RoadNetwork, goals: tuple[int, ...], car: Car, radius: float = 1.0) -> Problem:
    places = tuple(network.intersections[v] for v in goals)
    return Problem(network, places, radius, car, 30.0, 5.0, None, (), (), {})


@PLAIN
@given(
    angle=st.one_of(st.floats(-2.62, 2.62), st.just(math.pi), st.just(0.0)),
    lengths=st.tuples(st.floats(2.9, 8.0), st.floats(2.9, 8.0)),
    degree=st.integers(2, 4),
    radius=st.floats(0.9, 1.2),
    car=st.sampled_from(CARS),
    visit=st.booleans(),
)
def test_turns_join_the_lanes_and_stay_on_the_road(
    angle: float, lengths: tuple[float, float], degree: int, radius: float, car: Car, visit: bool
) -> None:
    turn = shape(Site(angle, *lengths, degree, radius, car, visit))
    w, c, s = car.w, math.cos(angle), math.sin(angle)
    places = [(-turn.before, -w)]
    for piece in turn.pieces:
        assert math.dist(places[-1], (piece.x, piece.y)) < 1e-9
        places += [along(piece, piece.length * k / 8) for k in range(1, 9)]
        assert abs(piece.bend) * piece.length <= 0.5
        if car.bounds.turning_radius:
            assert abs(piece.bend) <= 1.0 / car.bounds.turning_radius
    end = (turn.after * c + w * s, turn.after * s - w * c)
    assert math.dist(places[-1], end) < 1e-6
    if turn.cost >= IMPOSSIBLE:
        return
    for x, y in places:
        off_in = math.hypot(max(x, 0.0), y)
        off_out = math.hypot(min(x * c + y * s, 0.0), y * c - x * s)
        assert min(off_in, off_out) < 2.0 * w
    assert max(turn.before, turn.after) <= 0.5 * min(lengths) + 1e-9
    if visit:
        assert min(math.hypot(x, y) for x, y in [*places, end]) <= VISIT * radius + 0.02


def shortest_closed(network: RoadNetwork, goals: tuple[int, ...]) -> float:
    """Search over (lane, goals visited) for the shortest closed walk through all goals."""
    bit = {goal: 1 << k for k, goal in enumerate(goals)}
    whole = (1 << len(goals)) - 1
    best = math.inf
    for start in range(network.lanes):
        if network.lane_ends(start)[1] != goals[0]:
            continue
        heap, seen = [(0.0, start, 0)], set()
        while heap:
            far, lane, had = heapq.heappop(heap)
            if (lane, had) in seen:
                continue
            seen.add((lane, had))
            if lane == start and had == whole:
                best = min(best, far)
                break
            for other in network.successors(lane):
                more = had | bit.get(network.lane_ends(other)[1], 0)
                heapq.heappush(heap, (far + float(network.lengths[other >> 1]), other, more))
    return best


@pytest.mark.parametrize("network", [RoadNetwork.grid(2, 3), RoadNetwork.grid(1, 4), BENT])
@pytest.mark.parametrize("goals", [(0,), (3,), (0, 3), (1, 2), (0, 1, 3), (3, 0, 2, 1)])
def test_a_round_is_the_shortest_closed_route(network: RoadNetwork, goals: tuple[int, ...]) -> None:
    found = find_round(LaneGraph(network), goals)
    assert found is not None
    check_round(network, found, goals)
    assert found.length == pytest.approx(shortest_closed(network, goals), abs=1e-9)


def check_round(network: RoadNetwork, found: Round, goals: tuple[int, ...]) -> None:
    for lane, other in zip(found.lanes, found.lanes[1:] + found.lanes[:1], strict=True):
        assert other in network.successors(lane)
    assert found.length == pytest.approx(sum(float(network.lengths[lane >> 1]) for lane in found.lanes))
    assert {network.lane_ends(found.lanes[k])[1] for k in found.arrivals} >= set(goals)


def test_rounds_through_many_goals_visit_them_all() -> None:
    network = RoadNetwork.grid(4, 5)
    goals = tuple(range(0, 20, 2))
    found = find_round(LaneGraph(network), goals)
    assert found is not None
    check_round(network, found, goals)


def test_distances_agree_with_the_networks_routes() -> None:
    network = RoadNetwork.grid(3, 4)
    graph = LaneGraph(network)
    routes = network.routes_to(7)
    tables = [graph.distances(lane) for lane in graph.into[7]]
    for lane in range(network.lanes):
        ours = min(table[lane] for table in tables) + graph.length[lane]
        assert ours == pytest.approx(routes.distance[lane])


def test_free_flow_of_a_grid() -> None:
    network = RoadNetwork.grid(3, 4)
    whole = Instance(problem(network, (0,), Car()), (Pose(1.0, -0.3, 1.0, 0.0),), 60.0, (), 1, 0)
    flow = free_flow(whole)
    assert flow.arrivals == ((pytest.approx(11.0), 0),)
    assert flow.round_time == pytest.approx(6.0 / 0.7), "to the nearest other disc and back"
    assert [flow.rounds(t) for t in (15.7, 15.8, 24.2, 24.3)] == [0, 1, 1, 2]
    loop = free_flow(whole, turns=False)
    assert loop.arrivals[0] == pytest.approx((17.0, 0))
    assert loop.round_time == pytest.approx(12.0 / 0.7)
    assert [loop.rounds(t) for t in (24.2, 24.3, 41.4, 41.5)] == [0, 1, 1, 2]
    own = whole.problem
    once = round_time(own.network, own.goal_vertices, own.car.bounds.speed)
    assert once == flow.round_time


@PLAIN
@given(
    other=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.7, 0.7), st.floats(-3, 3)),
    own=st.tuples(st.floats(-0.7, 0.7), st.floats(-3.1, 3.1)),
    its=st.tuples(st.floats(-0.7, 0.7), st.floats(-3.1, 3.1)),
    box=st.booleans(),
)
def test_a_safe_motion_meets_nobody_or_leads_away(
    other: tuple[float, float, float], own: tuple[float, float], its: tuple[float, float], box: bool
) -> None:
    a, h, r = (0.25, 0.15, 0.0) if box else (0.0, 0.0, 0.177)
    reach = math.hypot(0.25, 0.15) if box else 0.177
    c, s = sincos(other[2])
    body, beside = Box(0.0, 0.0, 1.0, 0.0, a, h, r), Box(other[0], other[1], c, s, a, h, r)
    assume(separation(body, beside)[0] > 1e-6)
    travel = (0.7 + (3.15 * reach if box else 0.0)) / 30
    car = table(Vehicle, 1)[0]
    car.half_length, car.half_width, car.rounding, car.reach, car.period = a, h, r, reach, 1 / 30
    origin = Pose(0.0, 0.0, 1.0, 0.0)
    safe = motion_is_safe(origin, Command(*own), car, beside, travel)
    assert motion_is_safe(origin, Command(0.0, 0.0), car, beside, travel)
    if not safe:
        return
    met = box_contact(body, Drive(*own, 1.0), beside, Drive(*its, 1.0), 0.0, 1 / 30)
    if met < NEVER:
        stands = box_contact(body, Drive(*own, 1.0), beside, Drive(0.0, 0.0, 0.0), 0.0, 1 / 30)
        assert stands == NEVER


@PLAIN
@given(
    other=st.tuples(st.floats(-0.7, 0.7), st.floats(-0.5, 0.5), st.floats(-3.2, 3.2)),
    speed=st.sampled_from((-0.7, -0.2, 0.2, 0.7)),
    its=st.tuples(st.floats(-0.7, 0.7), st.floats(-3.1, 3.1)),
    rate=st.sampled_from((10.0, 30.0)),
)
def test_a_rectangle_that_slides_past_another_closes_in_on_it_in_no_contact(
    other: tuple[float, float, float], speed: float, its: tuple[float, float], rate: float
) -> None:
    a, h, period = 0.31, 0.14, 1.0 / rate
    car = table(Vehicle, 1)[0]
    car.half_length, car.half_width, car.reach, car.period = a, h, math.hypot(a, h), period
    car.fastest, car.slowest, car.yaw_most = 0.7, -0.7, 3.15
    c, s = sincos(other[2])
    body, beside = Box(0.0, 0.0, 1.0, 0.0, a, h, 0.0), Box(other[0], other[1], c, s, a, h, 0.0)
    apart = separation(body, beside)[0] > 0.003
    if not apart or not slides_on(Pose(0.0, 0.0, 1.0, 0.0), speed, car, beside):
        return
    own, drives = Drive(speed, 0.0, period), Drive(*its, period)
    met = box_contact(body, own, beside, drives, 0.0, period)
    if met < NEVER:
        before = max(met - 1e-7, 0.0)
        _, nx, _, _, _ = separation(driven(body, own, before), driven(beside, drives, before))
        assert speed * nx < 1e-6


def drive(controller: Lanes, car: Car, pose: tuple[float, float, float, float], ticks: int) -> np.ndarray:
    """Drive alone, by the exact motion, and return the poses."""
    poses = [pose]
    for tick in range(ticks):
        seen = Observation(tick, tick / 30, Pose(*poses[-1]), Twist(0.0, 0.0), Propositions(0, -1, -1, -1, 0), (), None)
        u, w = controller.act(seen)
        low, most = car.bounds.speed_low, car.bounds.yaw_rate
        u = min(max(u, low), car.bounds.speed)
        if car.bounds.turning_radius:
            most = min(most, abs(u) / car.bounds.turning_radius)
        poses.append(advance(*poses[-1], u, min(max(w, -most), most), 1 / 30))
    return np.array(poses)


@pytest.mark.parametrize("car", CARS)
@pytest.mark.parametrize("network", [RoadNetwork.grid(2, 3, 4.0), BENT], ids=["grid", "bent"])
def test_lanes_goes_round_its_goals_on_the_road(network: RoadNetwork, car: Car) -> None:
    goals = (0, 3)
    controller = Lanes()
    controller.start(problem(network, goals, car))
    (x0, y0), (x1, y1) = network.lane_line(0, -car.w)
    c, s = (x1 - x0) / math.dist((x0, y0), (x1, y1)), (y1 - y0) / math.dist((x0, y0), (x1, y1))
    poses = drive(controller, car, ((x0 + x1) / 2, (y0 + y1) / 2, c, s), 3000)
    assert network.on_road(poses[:, :2], 2.0 * car.w).all()
    for goal in goals:
        inside = np.hypot(*(poses[:, :2] - network.points[goal]).T) < 1.0
        assert np.count_nonzero(inside[1:] & ~inside[:-1]) >= 2
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert steps.sum() > 0.9 * 70.0


@pytest.mark.parametrize("theta", [0.0, 1.0, 2.5, -2.0])
def test_lanes_starts_from_anywhere_on_the_road(theta: float) -> None:
    network = RoadNetwork.grid(3, 3)
    for x, y in [(0.0, 0.0), (1.5, 0.55), (3.0, 3.0), (6.3, 1.5), (3.5, -0.4)]:
        controller = Lanes()
        controller.start(problem(network, (8,), Car()))
        poses = drive(controller, Car(), (x, y, math.cos(theta), math.sin(theta)), 900)
        assert network.on_road(poses[:, :2], 0.6).all()
        assert (np.hypot(*(poses[:, :2] - network.points[8]).T) < 1.0).any()


def test_lanes_without_goals_stands() -> None:
    controller = Lanes()
    controller.start(problem(RoadNetwork.grid(2, 2), (), Car()))
    assert (drive(controller, Car(), (0.0, 0.0, 1.0, 0.0), 5)[:, :2] == 0.0).all()


SCRIPT = """
from dubins_traffic.runs.single import Trial
from dubins_traffic.controllers.lanes import Lanes
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
instance = draw(load_config("demo"), 5, 0)
trial, lanes = Trial(instance), Lanes()
lanes.start(instance.problem)
for _ in range(120):
    command = lanes.act(trial.observation)
    print(command.speed.hex(), command.yaw_rate.hex())
    trial.advance(command)
"""


def test_compiled_and_interpreted_agree_bit_for_bit() -> None:
    answers = [
        subprocess.run(
            [sys.executable, "-c", SCRIPT],
            env={**os.environ, "NUMBA_DISABLE_JIT": off},
            cwd=Path(__file__).parents[2],
            check=True,
            capture_output=True,
        ).stdout
        for off in ("0", "1")
    ]
    assert answers[0] == answers[1]
    assert len(answers[0].splitlines()) == 120
