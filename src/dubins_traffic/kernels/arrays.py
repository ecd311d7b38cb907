"""Names for the array types that kernels take."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]
Bits: TypeAlias = npt.NDArray[np.uint32]
INFINITE = float("inf")
"""So far, so long: where there is none."""
BLOCK = 8
"""Cars whose columns stand together where a kernel takes several at once; the columns are so many numbers apart."""
WIDE = 8
"""How many of these are taken at once: loops run to a multiple of it."""


def distinct(keys: Sequence[Hashable]) -> tuple[list[int], Ints]:
    """Return where each distinct key stands first, and the number of each key among these, (B,).

    What many trials of a batch have in common is worked out once, and spread with the second array.
    """
    numbers: dict[Hashable, int] = {}
    index = [numbers.setdefault(key, len(numbers)) for key in keys]
    first = [index.index(number) for number in range(len(numbers))] if len(numbers) < len(index) else index
    return first, np.array(index, dtype=np.int64)


def fetch(array: Any, place: Any) -> None:
    """Bring all of the row of `array` (array or table) at `place` (a number for each of its first axes), or nothing."""
