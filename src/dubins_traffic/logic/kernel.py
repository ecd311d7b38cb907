"""The compiled loops that run tables over a batch; imported when monitors run."""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Grid
from dubins_traffic.logic.delays import Requests


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
    watch : (M,) int64
        The delay line whose waiting requests speak against it, or -1.
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
    watch: Ints
    letter: Ints
    target: Ints
    reset: Ints
    verdict: Ints
    clock_length: Ints


class Lines(NamedTuple):
    """D delay lines (`delays.Line`), one after another.

    Attributes
    ----------
    names_off : (D+1,) int64
        Where the propositions of each line begin in `names`.
    names : (N,) int64
        Columns of the input.
    letter_at, cell_at, letters : (D,) int64
        Where its table begins in `letter`, in `target` and `value`, and how many letters it has.
    ring_off : (D+1,) int64
        Where its ring begins: one place a tick.
    letter, target, value : int64
        The tables.
    """

    names_off: Ints
    names: Ints
    letter_at: Ints
    cell_at: Ints
    letters: Ints
    ring_off: Ints
    letter: Ints
    target: Ints
    value: Ints


@jit
def delay(values: Ints, lines: Lines, memory: Grid[Requests], rings: Ints) -> None:
    """Take one frame of every trial into the delay lines.

    Parameters
    ----------
    values : (B, P+D) int64
        The propositions, 0 or 1; the last D columns are set: the requests that come out.
    lines : Lines
        The delay lines.
    memory : (B, D) Requests
        Updated.
    rings : (B, R) int64
        The requests that wait; updated.
    """
    count = lines.letter_at.shape[0]
    for b in range(values.shape[0]):
        for d in range(count):
            valuation = 0
            first = lines.names_off[d]
            for i in range(first, lines.names_off[d + 1]):
                valuation |= (values[b, lines.names[i]] & 1) << (i - first)
            letter = lines.letter[lines.letter_at[d] + valuation]
            register = memory[b, d]
            cell = register.state * lines.letters[d] + letter + lines.cell_at[d]
            register.state = int(lines.target[cell])
            place = lines.ring_off[d] + register.place
            out = rings[b, place]
            rings[b, place] = lines.value[cell]
            register.waiting += lines.value[cell] - out
            register.place += 1
            if place + 1 == lines.ring_off[d + 1]:
                register.place = 0
            values[b, values.shape[1] - count + d] = out


@jit
def advance(values: Ints, tables: Tables, memory: Grid[Requests], state: Ints, clocks: Ints, verdicts: Ints) -> None:
    """Take one frame of every trial into account.

    Parameters
    ----------
    values : (B, P+D) int64
        The propositions, 0 or 1, and the delayed requests.
    tables : Tables
        The monitors.
    memory : (B, D) Requests
        Of the delay lines (`delay`).
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
            clock_off = tables.clock_off[m]
            expired = 0
            for c in range(count):
                if clocks[b, clock_off + c] == 0:
                    expired |= 1 << c
            letter = tables.letter[tables.letter_at[m] + valuation]
            cell = ((state[b, m] * tables.letters[m] + letter) << count) + expired + tables.cell_at[m]
            reset = tables.reset[cell]
            for c in range(count):
                if (reset >> c) & 1:
                    clocks[b, clock_off + c] = tables.clock_length[clock_off + c] - 1
                elif clocks[b, clock_off + c] > 0:
                    clocks[b, clock_off + c] -= 1
            target = tables.target[cell]
            state[b, m] = target
            verdict = tables.verdict[tables.verdict_at[m] + target]
            watch = tables.watch[m]
            if verdict == 2 and watch >= 0 and memory[b, watch].waiting > 0:
                verdict = 1
            formula = tables.part_of[m]
            verdicts[b, formula] = min(verdicts[b, formula], verdict)
