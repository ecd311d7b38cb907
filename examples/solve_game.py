"""Solve a game that `dubins-traffic synth ... --graph game.npz` has written, with nothing but its file and NumPy.

    python examples/solve_game.py game.npz

Prints how many positions there are, and from how many the ego wins. The nested fixpoint of GR(1) is evaluated as it
stands (Piterman, Pnueli and Sa'ar, VMCAI 2006, equation 2), which is slow: take small games. `docs/theory.md` says what
the arrays mean.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Flags = npt.NDArray[np.bool_]
Step = Callable[[Flags], Flags]


def winning(arrays: Mapping[str, npt.NDArray[Any]]) -> Flags:
    """Return from which positions (N,) the ego wins."""
    header = json.loads(arrays["header"].tobytes())
    ego_cell = arrays["ego_cell"]
    debts = _debts(arrays)

    def controllable(wanted: Flags) -> Flags:
        """Return where the ego can get into a set by its next turn, whatever the environment does."""
        moved = np.logical_or.reduceat(wanted[arrays["ego_to"]], arrays["ego_at"][:-1])
        safe = np.append(moved, False)  # the position after the last: the ego has been rammed
        return np.logical_and.reduceat(safe[arrays["to"]], arrays["to_at"][:-1])

    def recurring(won: Flags) -> Flags:
        for nodes in header["targets"]:
            base = np.isin(ego_cell, nodes) & controllable(won)
            won = won & _repeat(lambda near, base=base: base | _nearer(near, controllable, debts), np.zeros_like(won))
        return won

    return _repeat(recurring, np.ones(len(ego_cell), dtype=bool))


def _nearer(near: Flags, controllable: Step, debts: list[Flags]) -> Flags:
    """Return where the ego gets into `near`, or waits while something is owed that can't be owed for ever."""
    found = controllable(near)
    for owed in debts:
        found |= _repeat(lambda held, owed=owed: owed & controllable(near | held), np.ones_like(near))
    return found


def _repeat(step: Step, some: Flags) -> Flags:
    """Return the fixpoint that a monotone step reaches from a set."""
    while True:
        after = step(some)
        if np.array_equal(after, some):
            return some
        some = after


def _debts(arrays: Mapping[str, npt.NDArray[Any]]) -> list[Flags]:
    """Return for each debt of the environment in which positions (N,) it is owed."""
    owed, owed_at = arrays["owed"], arrays["owed_at"]
    position = np.repeat(np.arange(len(owed_at) - 1), np.diff(owed_at))
    return [np.isin(np.arange(len(owed_at) - 1), position[owed == kind]) for kind in np.unique(owed)]


def main() -> None:
    """Solve the game in the file that is named."""
    with np.load(sys.argv[1], allow_pickle=False) as archive:
        won = winning(dict(archive))
    print(json.dumps({"states": len(won), "winning": int(won.sum())}))


if __name__ == "__main__":
    main()
