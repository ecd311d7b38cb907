"""What kernels tell the processor to bring to its nearest memory, since they will read it soon.

It changes no number: interpreted it is nothing, and compiled instructions that nobody waits for (`kernels.fetching`).
"""

from __future__ import annotations

from typing import Any


def fetch(array: Any, place: Any) -> None:
    """Bring all of the row of `array` (array or table) at `place` (a number for each of its first axes), or nothing."""
