"""The compiled loop that runs tables over a batch; imported when monitors run."""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit


class Tables(NamedTuple):
    """The tables of M monitors, one after another; equal ones stand once.

    Attributes
    ----------
    names_off : (M+1,) int64
        Where the propositions of each monitor begin in `names`.
    names : (N,) int64
        Columns of the input.
    letter_at, cell_at, verdict_at : (M,) int64
        Where the table of each monitor begins in `letter`, in `target` and `reset`, and in `verdict`.
    letters, clock_count, clock_off : (M,) int64
        How many letters and clocks it has, and its first clock.
    part_of : (M,) int64
        The formula that it belongs to.
    letter, target, reset, verdict : int64
        See `automaton.Automaton`.
    clock_length : (C,) int64
        Ticks.
    """

    names_off: Ints
    names: Ints
    letter_at: Ints
    cell_at: Ints
    verdict_at: Ints
    letters: Ints
    clock_count: Ints
    clock_off: Ints
    part_of: Ints
    letter: Ints
    target: Ints
    reset: Ints
    verdict: Ints
    clock_length: Ints


@jit
def advance(values: Ints, tables: Tables, state: Ints, clocks: Ints, verdicts: Ints) -> None:
    """Take one frame of every trial into account.

    Parameters
    ----------
    values : (B, P) int64
        The propositions, 0 or 1.
    tables : Tables
        The monitors.
    state : (B, M) int64
        Updated.
    clocks : (B, C) int64
        Ticks left until each clock has run out; updated.
    verdicts : (B, F) int64
        Set: the least verdict of the parts of each formula.
    """
    for b in range(values.shape[0]):
        for f in range(verdicts.shape[1]):
            verdicts[b, f] = 3
        for m in range(state.shape[1]):
            valuation = 0
            first = tables.names_off[m]
            for i in range(first, tables.names_off[m + 1]):
                valuation |= (values[b, tables.names[i]] & 1) << (i - first)
            count = tables.clock_count[m]
            own = tables.clock_off[m]
            expired = 0
            for c in range(count):
                if clocks[b, own + c] == 0:
                    expired |= 1 << c
            letter = tables.letter[tables.letter_at[m] + valuation]
            cell = ((state[b, m] * tables.letters[m] + letter) << count) + expired + tables.cell_at[m]
            reset = tables.reset[cell]
            for c in range(count):
                if (reset >> c) & 1:
                    clocks[b, own + c] = tables.clock_length[own + c] - 1
                elif clocks[b, own + c] > 0:
                    clocks[b, own + c] -= 1
            target = tables.target[cell]
            state[b, m] = target
            verdict = tables.verdict[tables.verdict_at[m] + target]
            formula = tables.part_of[m]
            verdicts[b, formula] = min(verdicts[b, formula], verdict)
