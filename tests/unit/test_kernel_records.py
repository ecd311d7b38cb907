"""Tables with names: the same rows in compiled kernels and in plain Python."""

import numpy as np
import pytest

from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, layout, record, table


@record
class Driver:
    """A driver of these tests."""

    waited: int
    lane: int = -1
    speed: float
    seed: np.uint64


@jit
def wait(drivers: Rows[Driver], b: int, n: int) -> None:
    """Let a driver wait for a tick."""
    count_tick(drivers[b, n])


@jit
def count_tick(driver: Driver) -> None:
    """Count one more tick of waiting."""
    driver.waited += 1
    driver.speed = 0.5 * driver.speed


def test_rows_have_named_fields_with_first_values() -> None:
    drivers = table(Driver, (2, 3))
    assert drivers.shape == (2, 3)
    assert drivers["lane"].tolist() == [[-1, -1, -1], [-1, -1, -1]]
    drivers[1, 2].speed = 3.0
    assert drivers["speed"].tolist() == [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0]]
    assert isinstance(drivers[0, 0], Driver)
    assert layout(Driver).itemsize == 32


@pytest.mark.parametrize("call", [wait, getattr(wait, "py_func", wait)], ids=["as it is", "interpreted"])
def test_kernels_read_and_write_fields_by_name(call) -> None:
    drivers = table(Driver, (2, 3))
    drivers[1, 2].speed = 3.0
    call(drivers, 1, 2)
    assert drivers["waited"].tolist() == [[0, 0, 0], [0, 0, 1]]
    assert drivers[1, 2].speed == 1.5


def test_a_misspelt_field_is_an_error() -> None:
    with pytest.raises(AttributeError):
        table(Driver, 1)[0].waits = 1


def test_fields_are_numbers() -> None:
    with pytest.raises(TypeError, match="annotated int, float"):

        @record
        class _Named:
            name: str


@jit
def copy_driver(drivers: Rows[Driver], source: int, to: int) -> None:
    """Let a driver be as another one."""
    drivers[to, 0] = drivers[source, 1]


@pytest.mark.parametrize(
    "call", [copy_driver, getattr(copy_driver, "py_func", copy_driver)], ids=["as it is", "interpreted"]
)
def test_a_row_is_copied(call) -> None:
    drivers = table(Driver, (2, 3))
    drivers[1, 1].speed, drivers[1, 1].lane = 3.0, 7
    call(drivers, 1, 0)
    drivers[1, 1].speed = 4.0
    assert (drivers[0, 0].speed, drivers[0, 0].lane) == (3.0, 7)
