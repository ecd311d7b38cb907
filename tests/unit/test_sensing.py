import math

import numpy as np
import pytest

from dubins_traffic.cars.body import Car, DiscObstacle, PolygonObstacle
from dubins_traffic.cars.sensing import Surroundings, blur, neighbours, nothing_seen, rays_at, scan
from dubins_traffic.cars.state import Labels, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.records import numbers


def cars_at(*places):
    state = State.zeros(1, len(places))
    state.x[0] = [x for x, _ in places]
    state.y[0] = [y for _, y in places]
    return state


def test_neighbours_are_those_within_the_radius_in_order_of_index() -> None:
    state = cars_at((0, 0), (5.0, 0), (0, 5.0000001), (3, 4), (-1, 0))
    seen = nothing_seen(5)
    count = neighbours(0, 0, 5.0, seen, state, Labels.zeros(1, 5))
    assert seen.labels["car"][:count].tolist() == [0, 1, 3, 4]
    assert (seen.poses[2].x, seen.poses[2].y) == (3, 4)
    assert numbers(seen.labels, np.int64)[1].tolist() == [1, 0, -1, -1, -1, 0]


def test_neighbours_tell_whether_anything_but_places_has_changed() -> None:
    state, labels = cars_at((0, 0), (1, 0), (2, 0)), Labels.zeros(1, 3)
    seen = nothing_seen(3)

    def look() -> int:
        return neighbours(0, 0, 5.0, seen, state, labels)

    assert [look(), look()] == [3, -3]
    state.x[0, 1] = 1.5
    assert look() == -3
    assert seen.poses[1].x == 1.5
    for change in (
        lambda: state.x[0].put(2, 6.0),
        lambda: labels.bits[0].put(1, 4),
        lambda: state.x[0].put(2, 2.0),
    ):
        change()
        count = look()
        assert count in (2, 3)
        assert look() == -count
    assert seen.labels["car"].tolist() == [0, 1, 2]
    assert seen.labels[1].bits == 4


def test_noise_has_the_asked_size_and_keeps_headings_unit() -> None:
    rows = []
    for tick in range(3000):
        seen = nothing_seen(2)
        seen.poses["c"] = 1.0
        seen.labels["car"] = [0, 1]
        blur(seen, 2, np.uint64(9), 4, tick, 0.05, 0.1)
        rows.append(numbers(seen.poses, np.float64))
    rows = np.array(rows)
    assert rows[:, :, :2].std(axis=0) == pytest.approx(0.05, rel=0.05)
    assert np.arctan2(rows[:, :, 3], rows[:, :, 2]).std(axis=0) == pytest.approx(0.1, rel=0.05)
    assert np.hypot(rows[:, :, 2], rows[:, :, 3]) == pytest.approx(1.0, abs=1e-12)
    assert abs(np.corrcoef(rows[:, 0, 0], rows[:, 1, 0])[0, 1]) < 0.06


def test_a_scan_of_the_2016_layout() -> None:
    state = cars_at((0, 0), (2, 0), (0, -1), (-3, 0))
    obstacles = pack_obstacles([[DiscObstacle(0, 0.15, 0.1), PolygonObstacle(((3, 3), (4, 3), (4, 4), (3, 4)))]])
    angles = np.linspace(-2, 2, 300)
    ranges = np.zeros(300)
    scan(0, 0, 0.08, 5.0, rays_at(angles), ranges, Surroundings(state, pack_cars([Car()]), obstacles))

    def at(angle):
        return ranges[int(np.abs(angles - angle).argmin())]

    assert at(0.0) == pytest.approx(2 - 0.177, abs=1e-3)
    assert at(-math.pi / 2) == pytest.approx(1 - 0.177, abs=1e-3)
    assert at(math.pi / 2) == -math.inf  # 0.05 m away: nearer than the laser can tell
    assert at(math.pi / 4) == pytest.approx(math.hypot(3, 3), abs=2e-2)
    assert at(0.5) == math.inf
    assert ranges[0] == math.inf  # the car behind is outside the sector
