"""Names for the narrow arrays of the game, of which there are millions of entries."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Numbers: TypeAlias = npt.NDArray[np.int32]
"""Numbers of positions, places in lists, ranks."""
Cells: TypeAlias = npt.NDArray[np.int16]
"""Numbers of cells and goals."""
Bytes: TypeAlias = npt.NDArray[np.uint8]
Masks: TypeAlias = npt.NDArray[np.uint8 | np.int64]
"""A bit for each e-agent that may move: bytes, unless there are more than eight."""
Flags: TypeAlias = npt.NDArray[np.bool_]
