"""Elements of arrays in kernels of the package: at the same place compiled and interpreted, whatever the array is."""

from pathlib import Path

import numpy as np

from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.records import record, table
from tests.unit.test_tiers import cache, python

__all__ = ["cache"]

MINE = """
from dubins_traffic.kernels.compile import jit

@jit
def copy(source, target):
    '''Copy an array of two axes, element by element, the last row as a part of the array.'''
    for i in range(source.shape[0] - 1):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]
    last = source[source.shape[0] - 1]
    own = target[source.shape[0] - 1]
    for j in range(last.shape[0]):
        own[j] = last[j]
    return source[0, 1] + last[0]

@jit
def gather(values, places):
    '''Add up elements at places of any kind of integer.'''
    total = 0.0
    for k in range(places.size):
        total += values[places[k]]
    return total + values[3]

@jit
def drive(cars, b):
    '''Let the cars of a trial drive: rows of a table.'''
    total = 0.0
    for n in range(cars.shape[1]):
        car = cars[b, n]
        car.waited += n
        total += car.speed
    cars[b, 0] = cars[b, 1]
    return total

@jit
def greatest(values):
    '''Add up with code inside, which goes Numba's own way, and with what Numba offers.'''
    def twice(value):
        return 2.0 * value
    return twice(max(values[0], values[1])) + min(1, 2) + abs(-3)
"""
RUN = """
import pickle, sys
sys.path.insert(0, {folder!r})
from tests.unit.test_kernel_elements import Car, answers
import dubins_traffic_mine as mine
sys.stdout.write(repr(answers(mine)))
"""


@record
class Car:
    """A car of these tests."""

    waited: int
    speed: float


def answers(mine) -> list[object]:
    """Return what the kernels answer and write, for arrays and indices of many kinds."""
    whole = np.arange(40.0).reshape(5, 8)
    found: list[object] = []
    for source in (whole, whole.T, whole[::2, 1:6], np.asfortranarray(whole), whole.astype(np.int32)):
        for target in (np.zeros(source.shape), np.zeros(source.shape, order="F")):
            found += [float(mine.copy(source, target)), target.tolist()]
    for places in ("i8", "i4", "u8", "u2", "i1"):
        found += [
            float(mine.gather(whole[1], np.array([0, 5, 2], dtype=places))),
            float(mine.gather(whole[:, 1], np.ones(3, places))),
        ]
    cars = table(Car, (2, 3))
    cars["speed"] = np.arange(6.0).reshape(2, 3)
    found += [
        mine.drive(cars, 1),
        cars["waited"].tolist(),
        cars["speed"].tolist(),
        float(mine.greatest(whole[0])),
    ]
    if isinstance(mine.copy, Kernel):
        found.append([kernel.is_quick for kernel in (mine.copy, mine.gather, mine.drive, mine.greatest)])
    return found


def test_elements_are_where_they_are_interpreted(cache: Path, tmp_path: Path) -> None:
    (tmp_path / "dubins_traffic_mine.py").write_text(MINE)
    code = RUN.format(folder=str(tmp_path))
    compiled, said = python(cache, code, "compiled")
    plain, _ = python(cache, code, "interpreted")
    assert said == ""
    assert compiled == plain[:-1] + ", [True, True, True, True]]"
