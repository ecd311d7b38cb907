import math

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.simulators.embedded import Embedded
from tests.batches import pose, scene


def drive(instance, ticks, *commands):
    """Hold one (speed, yaw rate) per car and return the simulator and all contacts."""
    simulator = Embedded()
    simulator.reset([instance])
    contacts = []
    for _ in range(ticks):
        contacts += simulator.step(np.array([commands], dtype=float))[0]
    return simulator.state, contacts


@pytest.mark.parametrize(
    ("bounds", "asked", "given"),
    [
        (Bounds(speed=0.7, yaw_rate=3.0), (2.0, -9.0), (0.7, -3.0)),
        (Bounds(speed=0.7, yaw_rate=3.0), (-2.0, 1.0), (-0.7, 1.0)),
        (Bounds(speed=0.7, yaw_rate=3.0, speed_min=0.0), (-2.0, 1.0), (0.0, 1.0)),
        (Bounds(speed=0.7, yaw_rate=3.0, speed_min=0.4, turning_radius=1.0), (0.1, 1.0), (0.4, 0.4)),
        (Bounds(speed=0.7, yaw_rate=3.0, turning_radius=1.0), (0.0, 1.0), (0.0, 0.0)),
        (Bounds(speed=0.7, yaw_rate=3.0, turning_radius=0.1), (-0.7, -9.0), (-0.7, -3.0)),
    ],
)
def test_commands_are_clipped_speed_first(bounds, asked, given) -> None:
    simulator = Embedded()
    simulator.reset([scene([pose(0, 0)], Car(bounds=bounds))])
    commands = np.array([[asked]])
    simulator.step(commands)
    assert commands[0, 0].tolist() == list(given)


def test_a_dubins_car_cannot_stand_or_turn_sharply() -> None:
    car = Car(bounds=Bounds(speed=0.7, speed_min=0.3, turning_radius=0.5))
    state, _ = drive(scene([pose(0, 0)], car), 30, (0.0, 3.0))
    assert state.speed[0, 0] == 0.3
    assert state.yaw_rate[0, 0] == pytest.approx(0.6)


def test_head_on_cars_stop_where_they_touch() -> None:
    state, contacts = drive(scene([pose(0, 0), pose(2, 0, math.pi)]), 90, (0.5, 0.0), (0.5, 0.0))
    (contact,) = contacts
    assert contact.time == pytest.approx((2 - 0.354) / 1.0, abs=2e-9)
    assert state.x[0, 1] - state.x[0, 0] == pytest.approx(0.354, abs=1e-9)
    assert contact.closing == pytest.approx((0.5, 0.5))
    assert contact.moved == (True, True)
    assert (contact.nx, contact.ny) == pytest.approx((1.0, 0.0))
    assert list(state.speed[0]) == [0.0, 0.0]


def test_one_event_until_the_cars_have_parted() -> None:
    simulator = Embedded()
    simulator.reset([scene([pose(0, 0), pose(1, 0)])])

    def run(speed: float, ticks: int) -> int:
        return sum(len(simulator.step(np.array([[(speed, 0.0), (0.0, 0.0)]]))[0]) for _ in range(ticks))

    assert run(0.5, 60) == 1
    assert run(-0.2, 1) == 0  # 6.7 mm apart: the same event goes on
    assert run(0.5, 5) == 0
    assert run(-0.5, 1) == 0  # 16.7 mm apart: it is over
    assert run(0.5, 5) == 1


def test_touching_cars_may_move_apart_and_along_each_other() -> None:
    simulator = Embedded()
    state = simulator.reset([scene([pose(0, 0), pose(0.354, 0, math.pi / 2)])])
    for _ in range(30):
        assert not simulator.step(np.array([[(0.0, 0.0), (0.5, 0.0)]]))[0]
    assert state.y[0, 1] == pytest.approx(0.5)
    simulator.reset([scene([pose(0, 0, math.pi / 2), pose(0.354, 0, math.pi / 2)])])
    for _ in range(30):
        assert not simulator.step(np.array([[(0.5, 0.0), (0.5, 0.0)]]))[0]
    assert simulator.state.y[0].tolist() == pytest.approx([0.5, 0.5])


def test_fast_cars_do_not_tunnel() -> None:
    car = Car(bounds=Bounds(speed=50.0))
    state, contacts = drive(scene([pose(0, 0), pose(1.5, 0.3)], car), 1, (50.0, 0.0), (0.0, 0.0))
    (contact,) = contacts
    assert contact.x < 1.5
    assert math.hypot(state.x[0, 1] - state.x[0, 0], 0.3) == pytest.approx(0.354, abs=1e-9)


def test_contacts_come_in_order_of_time_and_the_fixed_cars_are_obstacles() -> None:
    car = Car(bounds=Bounds(speed=20.0))
    starts = [pose(0, 0), pose(0.5, 0), pose(1.1, 0, math.pi)]
    state, contacts = drive(scene(starts, car), 1, (0.0, 0.0), (-9.0, 0.0), (20.0, 0.0))
    assert [(c.car, c.other) for c in contacts] == [(0, 1), (1, 2)]
    assert contacts[0].time < contacts[1].time
    assert contacts[1].closing == pytest.approx((0.0, 20.0))
    assert state.x[0, 2] - state.x[0, 1] == pytest.approx(0.354, abs=1e-9)


def test_simultaneous_contacts_go_by_lowest_indices() -> None:
    starts = [pose(0, 0), pose(1, 0, math.pi), pose(0, 5), pose(1, 5, math.pi)]
    _, contacts = drive(scene(starts), 60, *[(0.25, 0.0)] * 4)
    assert [(c.car, c.other) for c in contacts] == [(0, 1), (2, 3)]


def test_a_rectangle_that_turns_hits_with_its_corner() -> None:
    car = Car(body=Rectangle(0.6, 0.2))
    _, contacts = drive(scene([pose(0, 0), pose(0, 0.35)], car), 60, (0.0, 1.0), (0.0, 0.0))
    (contact,) = contacts
    # The corner (0.3, 0.1) of the turning car meets the lower side y = 0.25 of the other one.
    angle = math.asin(0.25 / math.hypot(0.3, 0.1)) - math.atan2(0.1, 0.3)
    assert contact.time == pytest.approx(angle, abs=1e-8)
    assert contact.moved == (True, False)
    assert contact.y == pytest.approx(0.25, abs=1e-8)
    assert contact.closing[0] > 0.1
    assert contact.closing[1] == 0.0


def test_obstacles_stop_a_car() -> None:
    corner = PolygonObstacle(((1.0, -1.0), (2.0, -1.0), (1.5, 0.0), (2.0, 1.0), (1.0, 1.0), (1.2, 0.0)))
    state, contacts = drive(scene([pose(0, 0)], obstacles=[DiscObstacle(0, 5, 1), corner]), 120, (0.5, 0.0))
    (contact,) = contacts
    assert (contact.car, contact.other) == (0, -2)
    assert contact.moved == (True, False)
    # The notch of the polygon is a wedge; the disc rests on both its sides.
    half = math.atan2(0.2, 1.0)
    assert state.x[0, 0] == pytest.approx(1.2 - 0.177 / math.sin(math.pi / 2 - half), abs=1e-6)


def test_a_rate_for_all_trials_of_a_batch() -> None:
    with pytest.raises(Exception, match="rate"):
        Embedded().reset([scene([pose(0, 0)]), scene([pose(0, 0)], rate=10.0)])


def test_pairs_beyond_the_buffer_are_not_lost() -> None:
    """Sixty slow cars whose fast companion makes every pair a candidate: the buffer must grow."""
    car = Car(bounds=Bounds(speed=1000.0))
    starts = [pose(0.5 * k, 0) for k in range(60)]
    commands = [(1000.0, 0.0)] + [(0.0, 0.0)] * 59
    _, contacts = drive(scene(starts, car), 1, *commands)
    assert [(c.car, c.other) for c in contacts] == [(0, 1)]


@pytest.mark.parametrize("lay_out", [np.asfortranarray, np.float32, lambda commands: commands[:, ::-1][:, ::-1]])
def test_commands_of_any_layout_do_the_same(lay_out) -> None:
    instance = scene([pose(0.0, 0.0, 0.0), pose(2.0, 1.0, 0.5)])
    plain, other = Embedded(), Embedded()
    state, same = plain.reset([instance, instance]), other.reset([instance, instance])
    commands = np.array([[[0.5, 1.0], [9.0, -0.5]], [[0.25, 0.0], [0.5, 99.0]]])
    for asked in (commands, 0.5 * commands, commands[::-1].copy()):
        own = asked.copy()
        given = lay_out(asked.copy())
        plain.step(own)
        other.step(given)
        assert (given == own.astype(given.dtype)).all()
        assert (state.x == same.x).all()
        assert (state.s == same.s).all()
