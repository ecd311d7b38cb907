"""Blocks of columns with names: for loops that take several cars at once (`kernels.arrays.BLOCK`).

    @columns(BLOCK)
    class Places:
        x: Floats

    block = places[b, n // BLOCK]
    block.x[n % BLOCK] += 1.0

Compiled, a block is a pointer and a column an array at a fixed distance from it, so that the compiler knows how far
columns are apart and puts loops over them into vectors.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np

from dubins_traffic.kernels.records import Table

R = TypeVar("R")


def columns(size: int) -> Callable[[type[R]], type[R]]:
    """Make a class the type of the rows of structured arrays: each annotated field is `size` float64 numbers.

    Its tables are made by `kernels.records.table`; new ones are 0.
    """

    def make(kind: type[R]) -> type[R]:
        names = list(get_type_hints(kind))
        layout = np.dtype([(name, "f8", (size,)) for name in names])

        def at(rows: Any, far: int) -> Any:
            block = np.ndarray((), layout, rows, far)
            own = row()
            for name in names:
                setattr(own, name, block[name])
            return own

        row: Any = type(
            kind.__name__,
            (),
            {
                "__doc__": kind.__doc__,
                "__module__": kind.__module__,
                "__qualname__": kind.__qualname__,
                "__slots__": tuple(names),
                "FIRST_VALUES": {},
                "LAYOUT": layout,
            },
        )
        row.TABLE = type(f"{kind.__name__}Table", (Table,), {"KIND": staticmethod(at), "RECORD": row})
        return cast(type[R], row)

    return make
