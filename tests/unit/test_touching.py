import pytest

from dubins_traffic.cars.body import Body, Car, Disc, DiscObstacle, Obstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Contact, State
from dubins_traffic.cars.touching import Touching

SPEED, PERIOD = 0.5, 1 / 30
FAR = 50.0


def approach(body: Body, *obstacles: Obstacle, other: float) -> tuple[Contact, ...]:
    """Drive car 0 along the x axis toward car 1, which stands across at x = `other`; return all contacts."""
    touching = Touching(Car(body=body), obstacles, PERIOD)
    state = State.zeros(1, 2)
    state.x[0], state.c[0], state.s[0] = (0.0, other), (1.0, 0.0), (0.0, 1.0)
    state.speed[0, 0] = SPEED
    found: tuple[Contact, ...] = ()
    for tick in range(1, 61):
        state.x[0, 0] = tick * SPEED * PERIOD
        found += touching.update(tick, state)
    return found


@pytest.mark.parametrize(
    ("body", "way"),
    [(Disc(0.2), 1.005 - 0.2 - 0.2), (Rectangle(0.5, 0.3), 1.005 - 0.25 - 0.15)],
    ids=["discs", "rectangles"],
)
def test_cars_touch_once_when_their_bodies_meet(body: Body, way: float) -> None:
    (contact,) = approach(body, other=1.005)
    assert (contact.tick - 1) * SPEED * PERIOD < way <= contact.tick * SPEED * PERIOD
    assert (contact.car, contact.other) == (0, 1)
    assert (contact.nx, contact.ny) == pytest.approx((1.0, 0.0))
    assert contact.closing == pytest.approx((SPEED, 0.0))
    assert contact.moved == (True, False)
    assert contact.time == pytest.approx(contact.tick * PERIOD)


@pytest.mark.parametrize(
    "obstacle",
    [DiscObstacle(1.0, 0.0, 0.1), PolygonObstacle(((0.9, -0.5), (1.1, -0.5), (1.1, 0.5), (0.9, 0.5)))],
    ids=["disc", "polygon"],
)
def test_obstacles_are_touched(obstacle: Obstacle) -> None:
    contact = approach(Rectangle(0.5, 0.3), DiscObstacle(9.0, 9.0, 0.1), obstacle, other=FAR)[0]
    assert (contact.car, contact.other) == (0, -2)
    assert contact.tick * SPEED * PERIOD == pytest.approx(0.9 - 0.25, abs=SPEED * PERIOD)
    assert contact.closing == pytest.approx((SPEED, 0.0))
    assert contact.moved == (True, False)


def test_a_rectangle_that_turns_on_the_spot_meets_with_its_corner() -> None:
    touching = Touching(Car(body=Rectangle(0.6, 0.2)), (), PERIOD)
    state = State.zeros(1, 2)
    state.x[0], state.c[0], state.s[0] = (0.0, 0.35), (0.0, 0.0), (1.0, 1.0)
    assert touching.update(1, state) == ()
    state.c[0, 0], state.s[0, 0], state.yaw_rate[0, 0] = 1.0, 0.0, -0.9
    (contact,) = touching.update(2, state)
    assert contact.moved == (True, False)
    state.x[0, 1] = 0.404
    assert touching.update(3, state) == ()
    state.x[0, 1] = 0.35
    assert touching.update(4, state) == (), "they have not parted"
    state.x[0, 1] = 0.42
    assert touching.update(5, state) == ()
    state.x[0, 1] = 0.35
    assert len(touching.update(6, state)) == 1
