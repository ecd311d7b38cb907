"""Groups of arrays that kernels take as a pointer: the same in compiled kernels and in plain Python."""

import copy

import numpy as np
import pytest

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, record, table
from dubins_traffic.kernels.tables import Tables


@record
class Car:
    """A car of these tests."""

    waited: int
    speed: float


class Inner(Tables):
    """Some cars (B, N)."""

    car: Rows[Car]
    count: Ints


class Outer(Tables):
    """Places (B, N, 2) of the cars of an `inner`."""

    place: Floats
    inner: Inner


class Alone(Tables):
    """A car and the road that it drives, (M,) metres."""

    car: Car
    road: Floats


@jit
def roll(alone: Alone) -> float:
    """Drive along the road, and count its parts."""
    car = alone.car
    for k in range(alone.road.shape[0]):
        car.waited += 1
        car.speed += alone.road[k]
    return car.speed


@jit
def drive(outer: Outer, b: int) -> float:
    """Let the cars of a trial drive, and count their ticks."""
    inner = outer.inner
    total = 0.0
    for n in range(inner.count[b]):
        car = inner.car[b, n]
        outer.place[b, n, 1] += car.speed
        car.waited += 1
        total += outer.place[b, n, 1]
    return total


def outer() -> Outer:
    cars = table(Car, (2, 3))
    cars["speed"] = np.arange(6.0).reshape(2, 3)
    return Outer(np.ones((2, 3, 2)), inner=Inner(cars, np.array([1, 3])))


@pytest.mark.parametrize("call", [drive, getattr(drive, "py_func", drive)], ids=["as it is", "interpreted"])
def test_kernels_read_and_write_the_arrays(call) -> None:
    own = outer()
    assert call(own, 1) == 3.0 + 12.0
    assert own.place[1, :, 1].tolist() == [4.0, 5.0, 6.0]
    assert own.inner.car["waited"].tolist() == [[0, 0, 0], [1, 1, 1]]


def test_tables_are_not_changed_but_replaced() -> None:
    own = outer()
    with pytest.raises(AttributeError, match="can't be changed"):
        own.place = np.zeros((2, 3, 2))  # pyright: ignore[reportAttributeAccessIssue]
    other = own.replace(place=np.zeros((2, 3, 2)))
    assert drive(other, 1) == 12.0
    assert other.inner is own.inner
    with pytest.raises(TypeError, match="is made of place, inner"):
        Outer(np.zeros(1))


def test_a_copy_has_arrays_of_its_own() -> None:
    own = outer()
    drive(own, 1)
    other = copy.deepcopy(own)
    assert drive(other, 1) == 27.0
    assert own.inner.car["waited"].max() == 1


def test_arrays_are_contiguous() -> None:
    with pytest.raises(TypeError, match="follow each other"):
        _ = Inner(table(Car, (2, 3)), np.zeros(4, dtype=np.int64)[::2]).address


@pytest.mark.parametrize("call", [roll, getattr(roll, "py_func", roll)], ids=["as it is", "interpreted"])
def test_a_row_stands_in_a_group_by_itself(call) -> None:
    own = Alone(table(Car, 1)[0], np.array([1.0, 2.0]))
    other = copy.deepcopy(own)
    assert call(own) == 3.0
    assert (own.car.waited, other.car.waited) == (2, 0)
    assert call(other.replace(car=own.car)) == 6.0
    assert own.car.waited == 4
