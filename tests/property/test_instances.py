"""Instances: functions of (configuration, seed, trial), with valid starts, equal after writing and reading."""

import json
import re
from math import cos, floor, hypot, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon
from shapely.affinity import rotate, translate

from dubins_traffic.cars.body import Body, Car, Disc, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config, shipped_names
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.draw import draw, draw_many
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.overlap import body_shape, overlap
from dubins_traffic.problem.starts import TIGHT, Ground, Wish, check_given
from dubins_traffic.roads.generate import most_segments
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.judged import distinct_problems
from tests.roadnets import networks

quick = settings(max_examples=40, deadline=None, derandomize=True)
seeds = st.integers(0, 2**64 - 1)
trials = st.integers(0, 2**32 - 2)


def configuration(network: RoadNetwork, **changes: Any) -> dict[str, Any]:
    document: dict[str, Any] = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": network.to_document(),
        "e-agents": [{"type": "wander", "count": 2}],
        "number_trials": 3,
    }
    return document | {key.replace("e_agents", "e-agents"): value for key, value in changes.items()}


def nearest_lane(instance: Instance, n: int) -> tuple[int, float, float]:
    """Return the lane on whose right side car n stands headed along it, with its progress and offset."""
    pose, network = instance.starts[n], instance.problem.network
    for lane in range(network.lanes):
        tx, ty = network.tangents[lane >> 1] * (-1 if lane & 1 else 1)
        s, left = (float(value) for value in network.lane_coordinates(lane, [pose.x, pose.y]))
        aligned = abs(tx - pose.c) < 1e-12 and abs(ty - pose.s) < 1e-12
        inside = -1e-9 <= s <= network.lengths[lane >> 1] + 1e-9
        if aligned and inside and abs(left + instance.problem.car.w) < 1e-9:
            return lane, s, left
    raise AssertionError(f"car {n} at {pose} is in no right lane")


def clearances(instance: Instance) -> tuple[float, float]:
    """Return the least gap between two cars' reaches, and between a car's and a disc."""
    xy = np.array([(pose.x, pose.y) for pose in instance.starts])
    reach = instance.problem.car.body.reach
    between = min((hypot(*(xy[i] - xy[j])) for i in range(len(xy)) for j in range(i)), default=np.inf)
    disc = min(hypot(*(p - v)) for p in xy for v in instance.problem.network.points)
    return between - 2 * reach, disc - instance.problem.intersection_radius - reach


@quick
@given(networks(), seeds, trials)
def test_an_instance_is_a_function_of_seed_and_trial(network: RoadNetwork, seed: int, trial: int) -> None:
    config = load_config(configuration(network))
    first = draw(config, seed, trial)
    draw(config, seed, (trial + 1) % 2**32)
    again = draw(load_config(configuration(network, number_trials=1000)), seed, trial)
    assert first == again
    assert (first.seed, first.trial) == (seed, trial)
    assert draw(config, seed, trial ^ 1) != first
    assert draw(config, seed ^ 1, trial) != first


@quick
@given(networks(), seeds, st.sampled_from([{}, {"rectangle": {"length": 0.5, "width": 0.3}}]))
def test_starts_are_in_right_lanes_outside_discs_and_clear_of_each_other(
    network: RoadNetwork, seed: int, body: dict[str, Any]
) -> None:
    count = min(2, len(network.segments) - 1)
    car = {"body": body or {"disc": {}}}
    agents = [{"type": "wander", "count": count}]
    instance = draw(load_config(configuration(network, car=car, e_agents=agents)), seed)
    for n in range(count + 1):
        nearest_lane(instance, n)
    between, disc = clearances(instance)
    assert between >= TIGHT
    assert disc >= 0.0


@quick
@given(networks(most=3), seeds)
def test_where_cars_do_not_fit_the_error_says_how_many_do(network: RoadNetwork, seed: int) -> None:
    def crowd(count: int) -> Instance:
        agents = [{"type": "wander", "count": count}]
        return draw(load_config(configuration(network, e_agents=agents)), seed)

    with pytest.raises(InputError, match=r"only \d+ of 401 cars fit") as caught:
        crowd(400)
    fit = int(re.findall(r"only (\d+) of", str(caught.value))[0])
    packed = crowd(fit - 1)
    assert len(packed.starts) == fit
    for n in range(fit):
        nearest_lane(packed, n)
    assert clearances(packed)[0] >= TIGHT
    # Every right lane holds a car between any two discs 2.35 m apart on 3 m.
    assert fit >= network.lanes


@quick
@given(networks(), seeds, st.data())
def test_starts_are_clear_of_obstacles(network: RoadNetwork, seed: int, data: st.DataObject) -> None:
    obstacles: list[dict[str, Any]] = []
    shapes = []
    for k in range(min(4, len(network.segments) - 1)):
        a, b = network.points[network.ends[k]]
        x, y = (a + data.draw(st.floats(0.2, 0.8)) * (b - a)).tolist()
        if data.draw(st.booleans()):
            radius = data.draw(st.floats(0.05, 1.0))
            obstacles.append({"disc": {"x": x, "y": y, "radius": radius}})
            shapes.append(Point(x, y).buffer(radius, quad_segs=200))
        else:
            angle, size = data.draw(st.floats(0, 360)), data.draw(st.floats(0.1, 2.0))
            arrow = Polygon([(0, 0), (size, size), (0, 0.4 * size), (-size, size)])
            shapes.append(translate(rotate(arrow, angle, origin=(0, 0)), x, y))
            corners = [list(corner) for corner in shapes[-1].exterior.coords[:-1]]
            obstacles.append({"polygon": {"vertices": corners}})
    config = load_config(configuration(network, obstacles=obstacles, e_agents=[]))
    instance = draw(config, seed)
    pose = instance.starts[0]
    for shape in shapes:
        assert shape.distance(Point(pose.x, pose.y)) >= 0.177 - 1e-4
    assert instance_from_document(json.loads(json.dumps(instance_to_document(instance)))) == instance


@quick
@given(st.integers(6, 40), st.floats(0, 1), st.integers(0, 8), seeds)
def test_random_networks_have_room_for_rules_and_cars(intersections: int, share: float, agents: int, seed: int) -> None:
    least, most = intersections - 1, most_segments(intersections)
    wanted = {
        "intersections": intersections,
        "segments": least + round(share * (most - least)),
        "rigid_motion": True,
    }
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": {"random": wanted},
        "e-agents": [{"type": "wander", "count": agents}],
        "rules": True,
    }
    instance = draw(load_config(document), seed)
    network = instance.problem.network
    assert len(network.intersections) == intersections
    assert len(network.segments) == wanted["segments"]
    for n in range(agents + 1):
        nearest_lane(instance, n)
    between, disc = clearances(instance)
    assert between >= TIGHT
    assert disc >= 0.0
    assert draw(load_config(document), seed, 1).problem.network != network


@quick
@given(st.integers(2, 5), st.integers(2, 5), st.floats(0, 1), seeds)
def test_grids_lose_the_share_of_segments_asked_for(rows: int, columns: int, removed: float, seed: int) -> None:
    grid = {"rows": rows, "columns": columns, "removed": removed, "length": 4}
    document = {"version": 1, "problem_domain": "dubins_traffic", "network": {"grid": grid}}
    whole = len(RoadNetwork.grid(rows, columns).segments)
    spare = whole - (rows * columns - 1)
    if floor(removed * whole + 1e-9) > spare:
        with pytest.raises(InputError, match=r"network\.grid\.removed"):
            draw(load_config(document), seed)
    else:
        network = draw(load_config(document), seed).problem.network
        assert len(network.segments) == whole - floor(removed * whole + 1e-9)
        assert network.length == 4.0


def test_drawn_starts_reach_all_of_the_free_lanes() -> None:
    network = RoadNetwork.grid(2, 2, length=4.0)
    config = load_config(configuration(network, e_agents=[]))
    found = [nearest_lane(draw(config, 9, k), 0)[:2] for k in range(800)]
    counts = np.bincount([lane for lane, _ in found], minlength=8)
    assert counts.min() > 60  # 100 each is expected
    along = np.array([s for _, s in found])
    low, high = (
        1.0 + 0.177,
        3.0 - 0.177,
    )  # less at the corner inside the disc, where the lane lies off its centre
    assert along.min() < low + 0.05
    assert along.max() > high - 0.05
    assert abs(along.mean() - 2.0) < 0.06


@quick
@given(networks(), seeds)
def test_goals_and_durations_follow_their_bounds(network: RoadNetwork, seed: int) -> None:
    places = len(network.intersections)
    bounds = [1, places + 3]
    config = load_config(configuration(network, e_agents=[], duration_bounds=[5, 7], number_goals_bounds=bounds))
    for trial in range(20):
        instance = draw(config, seed, trial)
        goals = instance.problem.goals
        assert 1 <= len(goals) <= places + 3
        assert len(set(goals)) == min(len(goals), places)
        assert set(goals) <= set(network.intersections)
        assert instance.duration in (5.0, 6.0, 7.0)


def test_durations_numbers_of_goals_and_goals_are_uniform() -> None:
    config = load_config("mc-small-4grid-agents2")
    drawn = [draw(config, 3, k) for k in range(1200)]
    durations = np.bincount([round(i.duration) for i in drawn])[5:]
    assert len(durations) == 6
    assert abs(durations - 200).max() < 60
    numbers = np.bincount([len(i.problem.goals) for i in drawn])[1:]
    assert len(numbers) == 3
    assert abs(numbers - 400).max() < 80
    first = np.bincount([i.problem.goal_vertices[0] for i in drawn])
    assert len(first) == 12
    assert abs(first - 100).max() < 45


@quick
@given(networks(), seeds)
def test_an_instance_equals_itself_after_writing_and_reading(network: RoadNetwork, seed: int) -> None:
    agents = [
        {"type": "wander/wander", "name": "one"},
        {"type": "loop", "name": "round"},
        {"type": "parked", "name": "van", "parameters": {"vacates_after": None}},
        {"type": "scripted", "name": "film", "parameters": {"commands": [[1, 0.1, 0.3]]}},
    ]
    config = load_config(
        configuration(
            network,
            e_agents=agents[: len(network.segments) - 1],
            car={
                "w": 0.29,
                "body": {"rectangle": {"length": 0.31, "width": 0.2}},
                "bounds": {"speed_min": 0.1},
            },
            rate=29.97,
            laser={"rays": 7},
            obstacles=[{"disc": {"x": 1e5, "y": 0.1, "radius": 0.1}}],
            rules={"tickets": 2},
            sensing_radius=6.1,
            disturbances={"position_noise": 0.01, "command_delay": 2},
            end_on_collision=True,
            duration=12.34,
        )
    )
    instance = draw(config, seed, 5)
    text = json.dumps(instance_to_document(instance))
    again = instance_from_document(json.loads(text))
    assert again == instance
    assert json.dumps(instance_to_document(again)) == text


@quick
@given(networks(), seeds)
def test_a_loop_starts_on_its_cycle_and_its_cycle_is_closed(network: RoadNetwork, seed: int) -> None:
    instance = draw(load_config(configuration(network, e_agents=[{"type": "loop", "name": "bus"}])), seed)
    cycle = [tuple(point) for point in instance.e_agents[0].parameters["cycle"]]
    lanes = {network.lane_ends(lane): lane for lane in range(network.lanes)}
    numbers = [network.vertex(point) for point in cycle]
    own = [lanes[a, b] for a, b in zip(numbers, numbers[1:] + numbers[:1], strict=True)]
    assert nearest_lane(instance, 1)[0] in own
    for lane, following in zip(own, own[1:] + own[:1], strict=True):
        assert following in network.successors(lane)


def test_version_0_starts_the_ego_at_the_origin_only_on_the_road() -> None:
    document = load_config("demo").to_document()
    assert draw(load_config(document)).starts[0] == (0.0, 0.0, 1.0, 0.0)
    document["rnd"]["transform"] = [50, 50, 1]
    nearest_lane(draw(load_config(document)), 0)
    document["rnd"]["transform"] = [0.59, 0, 0]
    assert draw(load_config(document)).starts[0] == (0.0, 0.0, 1.0, 0.0)


def test_version_0_called_version_1_means_the_same_but_for_the_ego_s_start() -> None:
    document = load_config("demo").to_document()
    for trial in range(5):
        old = draw(load_config(document), 1, trial)
        new = draw(load_config(document | {"version": 1, "ego": {"start": "origin"}}), 1, trial)
        assert new == old
        drawn = draw(load_config(document | {"version": 1}), 1, trial)
        assert (drawn.problem, drawn.duration) == (old.problem, old.duration)
        assert drawn.starts[0] != old.starts[0]


def test_a_crowd_is_drawn_quickly_and_stands_apart() -> None:
    network = RoadNetwork.grid(20, 20)
    config = load_config(configuration(network, e_agents=[{"type": "wander", "count": 700}]))
    instance = draw(config, 1)
    lines = LineString([(pose.x, pose.y) for pose in instance.starts])
    assert len(lines.coords) == 701
    assert clearances(instance)[0] >= TIGHT
    assert instance.names[:3] == ("ego", "agent0", "agent1")


@pytest.mark.parametrize("name", shipped_names())
def test_shipped_configurations_can_be_drawn(name: str) -> None:
    config = load_config(name)
    for trial in range(3):
        instance = draw(config, 0, trial)
        assert isinstance(instance.problem.car.body, Rectangle if name == "suburb" else Disc)
        assert instance_from_document(json.loads(json.dumps(instance_to_document(instance)))) == instance


GRID = {"grid": {"rows": 3, "columns": 3, "length": 4.0}}
LOOPS = [
    {"type": "loop", "name": "loop", "count": 2},
    {"type": "lawful", "name": "round", "parameters": {"goes": "loop"}},
    {"type": "wander", "name": "agent"},
]


@pytest.mark.parametrize(
    "changes",
    [
        {"network": GRID, "e-agents": [{"type": "lawful", "count": 6}], "rules": {}},
        {"network": GRID, "e-agents": LOOPS, "obstacles": [{"disc": {"x": 4.0, "y": 0.3, "radius": 0.2}}]},
        {"network": {"grid": {"rows": 2, "columns": 2}}, "e-agents": [{"type": "wander", "count": 12}]},
        {"network": {"random": {"intersections": 7, "segments": 8}}, "e-agents": LOOPS},
        {"network": GRID, "ego": {"start": [2.0, -0.3, 0.0]}, "e-agents": [{"type": "wander", "count": 4}]},
        {"network": GRID, "ego": {"start": "origin"}, "goals": [[1, 1]], "duration": 3.0},
    ],
    ids=["shared", "loops", "crowded", "own-networks", "given", "all-given"],
)
def test_many_instances_drawn_at_once_are_those_drawn_one_by_one(changes: dict[str, Any]) -> None:
    document = {"version": 1, "problem_domain": "dubins_traffic", "number_trials": 1, **changes}
    numbers = [*range(20), 2**32 - 2, 5]
    many = list(draw_many(load_config(document), 2**63 + 1, numbers))
    assert [instance.trial for instance in many] == numbers
    for instance in many:
        alone = draw(load_config(document), 2**63 + 1, instance.trial)
        assert instance_to_document(instance) == instance_to_document(alone)


def test_instances_of_a_configuration_are_alike_but_for_roads() -> None:
    rules = {"network": {"random": {"intersections": 5, "segments": 5}}, "rules": True}
    config = load_config({"version": 1, "problem_domain": "dubins_traffic", "number_trials": 1, **rules})
    kinds, index = distinct_problems([instance.problem for instance in draw_many(config, 1, range(8))])
    assert len(kinds) == 1
    assert index.tolist() == [0] * 8


@pytest.mark.parametrize("body", [Disc(0.1), Rectangle(0.3, 0.1)])
@quick
@given(data=st.data())
def test_given_starts_that_overlap_are_found_as_by_looking_at_all_pairs(body: Body, data: st.DataObject) -> None:
    car = Car(body=body)
    near = st.floats(-0.7, 0.7)
    angles = st.sampled_from([0.0, 0.4, 1.6, -2.5])
    poses = [
        Pose(x, y, cos(theta), sin(theta))
        for x, y, theta in data.draw(st.lists(st.tuples(near, near, angles), max_size=8))
    ]
    shapes = [body_shape(car.body, pose) for pose in poses]
    pairs = [(n, m) for n in range(len(poses)) for m in range(n) if overlap(shapes[n], shapes[m])]
    ground = Ground(RoadNetwork.grid(2, 2), car, 1.0, ())
    wishes = [Wish(pose, None, f"starts[{n}]") for n, pose in enumerate(poses)]
    names = [f"car {n}" for n in range(len(poses))]
    if pairs:
        n, m = pairs[0]
        with pytest.raises(InputError, match=rf"^starts\[{n}\]: car {n} overlaps car {m}:"):
            check_given(ground, names, wishes)
    else:
        check_given(ground, names, wishes)
