"""What kernels keep from tick to tick is still so: places on the roads, and how far cars are apart."""

import numpy as np
import pytest

from dubins_traffic.cars.near import CELL, list_near
from dubins_traffic.cars.state import NONE
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.engine.group import Group
from dubins_traffic.kernels.arrays import BLOCK
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import table as rows_of
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.roads.lookup import ValidCell, nearest_arm, valid_cell
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.labeller import Labeller


@pytest.mark.parametrize("radius", [1.2, 9.0])
def test_nearest_segment_and_vertex_are_the_same_in_all_of_a_patch(radius) -> None:
    network = RoadNetwork.grid(3, 4, 4.0)
    table = pack([network], [0.6])
    random = np.random.default_rng(3)
    row = rows_of(ValidCell, 1)[0]
    filled = forked = 0
    for x, y in random.uniform((-1.0, -1.0), (13.0, 9.0), (400, 2)):
        valid_cell(table, 0, x, y, radius, row)
        if not (row.low_x < row.high_x and row.low_y < row.high_y):
            continue
        filled += 1
        assert row.low_x <= x <= row.high_x
        assert row.low_y <= y <= row.high_y
        points = random.uniform((row.low_x, row.low_y), (row.high_x, row.high_y), (20, 2))
        nearest = network.nearest_segment(points)[0]
        if row.segment < 0:
            forked += 1
            assert (network.ends[nearest] == row.vertex).any(axis=1).all()
            assert [nearest_arm(table, 0, row.vertex, *point)[0] for point in points] == nearest.tolist()
        else:
            assert (nearest == row.segment).all()
        vertex, away = network.nearest_intersection(points)
        assert ((vertex == row.vertex) | (away > radius)).all()
    assert filled > 300
    assert forked > 50


@pytest.mark.parametrize("agents", [6, 30])
def test_no_car_is_nearer_than_is_known(agents) -> None:
    config = load_config(
        {
            "version": 1,
            "problem_domain": "dubins_traffic",
            "network": {"grid": {"rows": 4, "columns": 4, "length": 4.0}},
            "rules": {},
            "e-agents": [{"type": "lawful", "name": "agent", "count": agents}],
            "number_trials": 1,
            "duration": 20,
        }
    )
    instance = draw(config, 1, 0)
    group = Group([instance], keeps_rules=True)
    cars = pack_cars([instance.problem.car])
    for _ in range(60):
        group.advance(7)
        own, tick = group.world.spacing, int(group.ticks[0])
        far = np.hypot(*(position - position.T for position in (group.state.x, group.state.y)))
        np.fill_diagonal(far, np.inf)
        drift = cars.speed_high[0] * instance.problem.period
        lost = 2.0 * drift * (tick - own.since[0])
        assert (own.apart[0] - lost - 1e-6 <= np.minimum(far.min(axis=1), CELL if agents > 24 else np.inf)).all()
        assert own.least[0] <= own.apart[0, : agents + 1].min()
        count = list_near(group.state, 0, tick, 4.0, 4.0, 3.0, own)
        near = np.hypot(group.state.x[0] - 4.0, group.state.y[0] - 4.0) <= 3.0
        assert set(np.flatnonzero(near)) <= set(own.near[:count])


@jit
def total(scale: float, one, two) -> float:
    found = 0.0
    for k in range(one.shape[0]):
        found += scale * (one[k] + two[k])
    return found


def test_a_bound_kernel_reads_its_arrays_at_each_call() -> None:
    one, two = np.ones(3), np.zeros(3)
    call = bound(total)
    assert call(2.0, one, two) == total(2.0, one, two) == 6.0
    two[:] = 1.0
    assert call(2.0, one, two) == 12.0


def test_labels_are_the_same_in_all_of_the_rectangle_in_which_they_are_kept() -> None:
    config = load_config(
        {
            "version": 1,
            "problem_domain": "dubins_traffic",
            "network": {"grid": {"rows": 3, "columns": 4, "length": 4.0}},
            "rules": {},
            "e-agents": [{"type": "lawful", "name": "agent", "count": 6}],
            "number_trials": 1,
            "duration": 20,
        }
    )
    instance = draw(config, 1, 0)
    problem = instance.problem
    network = problem.network
    group = Group([instance], keeps_rules=True)
    labeller = Labeller([instance])
    labels = labeller.reset(group.state)
    random = np.random.default_rng(4)
    looked = certain = doubtful = 0
    for tick in range(1, 300):
        group.advance()
        labeller.update(tick, group.state, [()])
        assert (labels.bits == group.labels.bits).all()
        for n in range(7):
            block, k = labeller.memory.kept[0, n // BLOCK], n % BLOCK
            row = {name: getattr(block, name)[k] for name in type(block).__slots__}
            low = np.array([row["valid_low_x"], row["valid_low_y"]])
            high = np.array([row["valid_high_x"], row["valid_high_y"]])
            if tick % 10 != n or not (low < high).all():
                continue
            looked += 1
            points = random.uniform(low, high, (60, 2))
            segment, far = network.nearest_segment(points)
            vertex, away = network.nearest_intersection(points)
            to_vertex = np.hypot(*(points - (row["vertex_x"], row["vertex_y"])).T) ** 2
            kept = (row["ring_low"] < to_vertex) & (to_vertex < row["ring_high"])
            offset = points - (row["from_x"], row["from_y"])
            along = offset @ (row["axis_x"], row["axis_y"])
            aside = offset @ (-row["axis_y"], row["axis_x"])
            kept &= (row["along_low"] < along) & (along < row["along_high"])
            kept &= (row["aside_low"] < aside) & (aside < row["aside_high"])
            way = points - (row["vertex_x"], row["vertex_y"])
            sure = np.ones(len(points), dtype=bool)
            for side in ("arm", "right", "left"):
                sure &= way @ (row[f"{side}_x"], row[f"{side}_y"]) > row["arm_least"]
            assert (segment[kept & sure] == labels.segment[0, n]).all()
            doubtful += int((kept & ~sure).sum())
            kept &= segment == labels.segment[0, n]
            certain += int((kept & sure).sum())
            segment, far, vertex, away = segment[kept], far[kept], vertex[kept], away[kept]
            cross = problem.intersection_radius + problem.car.body.reach
            assert (segment == labels.segment[0, n]).all()
            assert (far <= problem.car.lane_width).all()
            assert (np.where(away < problem.intersection_radius, vertex, NONE) == labels.at[0, n]).all()
            assert (np.where(away < cross, vertex, NONE) == labels.crosses[0, n]).all()
    assert looked > 100
    assert certain > 1000
    assert doubtful > 50
