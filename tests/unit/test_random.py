from collections import Counter

import numpy as np
import pytest

from dubins_traffic.kernels import random
from dubins_traffic.kernels.philox import Draws, philox4x32

# Known answers distributed with the authors' library Random123.
KNOWN = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    ((0xFFFFFFFF,) * 4, (0xFFFFFFFF,) * 2, (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD)),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]


@pytest.mark.parametrize("function", [philox4x32, random.philox4x32])
@pytest.mark.parametrize(("counter", "key", "answer"), KNOWN)
def test_philox_gives_the_known_answers(function, counter, key, answer) -> None:
    words = function(*(np.uint64(word) for word in (*counter, *key)))
    assert tuple(int(word) for word in words) == answer


def test_compiled_and_plain_numbers_are_equal() -> None:
    seed = np.uint64(0xDEADBEEFCAFEF00D)
    for trial in range(3):
        for draw in range(5):
            args = (seed, trial, 2, 77, draw)
            assert random.uniform(*args) == random.uniform.py_func(*args)
            assert random.below(*args, 7) == random.below.py_func(*args, 7)
            assert random.bell(*args) == random.bell.py_func(*args)


def test_moments() -> None:
    seed = np.uint64(5)
    uniform = np.array([random.uniform(seed, 0, 1, k, 0) for k in range(20_000)])
    assert 0 <= uniform.min() < 1e-3 < 1 - 1e-3 < uniform.max() < 1
    assert abs(uniform.mean() - 0.5) < 0.01
    bell = np.array([random.bell(seed, 0, 1, k, 0) for k in range(20_000)])
    assert abs(bell.mean()) < 0.03
    assert abs(bell.std() - 1) < 0.02


def test_draws_are_fair_and_distinct() -> None:
    draws = Draws(2**64 - 1, 3, 0)
    counts = Counter(draws.between(1, 6) for _ in range(6000))
    assert sorted(counts) == [1, 2, 3, 4, 5, 6]
    assert max(counts.values()) - min(counts.values()) < 200
    assert sorted(draws.shuffled(10)) == list(range(10))
    assert len(set(draws.sample(50, 1000))) == 50
    assert Draws(1, 2, 3).uniform() == Draws(1, 2, 3).uniform() != Draws(1, 2, 4).uniform()
