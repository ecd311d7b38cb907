"""Tables with names: the same rows in compiled kernels and in plain Python."""

import gc
import pickle
import weakref
from copy import deepcopy

import numpy as np
import pytest

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows, columns, layout, record, stack, table


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


@columns(4)
class Pair:
    """Two columns of these tests."""

    near: Floats
    far: Floats


@jit
def spread_out(pairs: Rows[Pair], b: int) -> None:
    """Take a block's far numbers from its near ones."""
    block = pairs[b]
    near, far = block.near, block.far
    for k in range(4):
        far[k] = 2.0 * near[k]


@pytest.mark.parametrize("call", [spread_out, getattr(spread_out, "py_func", spread_out)], ids=["as it is", "plain"])
def test_blocks_have_columns_with_names(call) -> None:
    pairs = table(Pair, 2)
    pairs[1].near[2] = 1.5
    call(pairs, 1)
    assert pairs["far"].tolist() == [[0.0] * 4, [0.0, 0.0, 3.0, 0.0]]


def test_tables_that_are_stacked_copied_and_pickled_have_rows_of_their_own() -> None:
    one, two = table(Driver, 2), table(Driver, 2)
    two[1].waited = np.int64(7)
    both = stack([one, two])
    twin = deepcopy(both)
    again = pickle.loads(pickle.dumps(both))
    both[1, 1].waited += 1
    assert (two[1].waited, both[1, 1].waited, twin[1, 1].waited, again[1, 1].waited) == (7, 8, 7, 7)
    assert both[[1, 0]][0, 1].waited == 8


def test_an_unsigned_field_wraps_round() -> None:
    driver = table(Driver, 1)[0]
    driver.seed = np.uint64(2**64 - 1)
    with np.errstate(over="ignore"):
        driver.seed += np.uint64(2)
    assert driver.seed == 1


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


@pytest.mark.parametrize(
    "drawn",
    [
        lambda: table(Driver, (4, 2)),
        lambda: table(Driver, (4, 2)).copy(),
        lambda: deepcopy(table(Driver, (4, 2))),
        lambda: pickle.loads(pickle.dumps(table(Driver, (4, 2)))),
        lambda: stack([table(Driver, 2), table(Driver, 2), table(Driver, 2)]),
        lambda: table(Driver, (4, 2))[[0, 1, 1]],
        lambda: table(Driver, (4, 2))[1:],
        lambda: table(Driver, (3, 4, 2))[1],
        lambda: table(Driver, (4, 2))[np.arange(4) > 0],
    ],
)
def test_a_table_that_nobody_uses_is_let_go_with_all_that_it_knows(drawn) -> None:
    own = drawn()
    own[1, 1].waited = 3
    assert own[1][1].waited == own["waited"][1, 1] == own[1:][0, 1].waited == 3
    own[1][1].speed = 2.0
    assert own[1, 1] is own[1, 1]
    assert own[1, 1].speed == own["speed"][1, 1] == own[1]["speed"][1] == 2.0
    left = weakref.ref(own)
    del own
    gc.collect()
    assert left() is None
