"""Margins: by how much the ego keeps or breaks each rule, the least value over its frames (partly compiled).

They are the robustness of its rules (`logic.robustness`). The signals of rules 1 and 2, in metres, are the gap to the
nearest other body, the distance of the centre to the edge of the road, and how far the body reaches beyond the line at
which `left` rises (or, once it has risen, falls); `overtaking` and `hemmed` are infinite; that of `turned` is how much
farther the ego could have backed. The robustness of ``[] (left -> overtaking)`` is the least margin to the line while
the ego does not overtake, that of ``[] (left -> <>[0,d] (!left | hemmed))`` the least of the greatest margins within d.
"""

from __future__ import annotations

import math
from math import sqrt
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from dubins_traffic.cars.tables import CarTable
from dubins_traffic.kernels.arrays import INFINITE, Floats, Ints
from dubins_traffic.kernels.boxes import Box
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Grid, Rows, record, table
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.logic.formula import ticks
from dubins_traffic.roads.lookup import distance2, lane_coordinates, lane_direction_at, nearest_segment
from dubins_traffic.roads.table import RoadTable
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.shape import half_extent
from dubins_traffic.scoring.verdict import EGO_NAME, Verdict

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from dubins_traffic.rules.breach_log import EntryMargins
    from dubins_traffic.rules.parameters import RuleParameters

MEASURED: Final = ("1.road", "2.left", "2.return", "2.turn")
"""The rules whose margins `find_margins` finds, in the order of `EgoMargins`."""
ENTERED: Final = ("3.stop", "3.order", "3.clear")
"""The rules whose margins the referee finds, in the order of `rules.breach_log.EntryMargins`."""
LIVENESS: Final = "1.goal"
MARGINS: Final = ("1.collision", *MEASURED, *ENTERED, LIVENESS)
"""The columns of `margins_of`."""
UNITS: Final = {"3.stop": "s", "3.order": "s", LIVENESS: "s"}
"""Units of the margins that are not in metres."""
SURE: Final = 1e-9
"""Least absolute value of a margin in `margins_of`, with the sign of the verdict."""


@record
class MarginRules:
    """The parameters on which the margins of one trial depend."""

    left_set: float
    left_release: float
    """Where `left` rises and where it falls, metres."""
    turn_back: float
    """How far progress falls before a lane state flips, metres."""
    window: int
    """Ticks within which the ego must be back."""


@record
class EgoFrame:
    """The ego in one frame."""

    x: float
    """Where its centre is, metres."""
    y: float
    """Where its centre is, metres."""
    c: float
    """Cosine of its heading."""
    s: float
    """Sine of its heading."""
    bits: int
    """Its flags (`rules.propositions`)."""
    lane: int
    """Its lane state."""


@record
class EgoMargins:
    """The margins of one trial, metres; infinite where nothing could break the rule."""

    road: float = np.inf
    line: float = np.inf
    back: float = np.inf
    turn: float = np.inf
    """The margins of 1.road, 2.left, 2.return and 2.turn."""


class MarginTables(Tables):
    """The tables from which a batch's margins are found: `rules` (B,), `roads`, `cars`; `signal` (F,) is scratch."""

    rules: Rows[MarginRules]
    roads: RoadTable
    cars: CarTable
    signal: Floats


def margin_rules(rules: Sequence[RuleParameters], periods: Sequence[float], index: Ints) -> Rows[MarginRules]:
    """Return the parameters of the margins of trials; trial b has the rules and the period (s) of number index[b]."""
    rows: Any = table(MarginRules, len(index))
    numbers: list[int] = index.tolist()
    rows["left_set"] = [rules[k].left_set for k in numbers]
    rows["left_release"] = [rules[k].left_release for k in numbers]
    rows["turn_back"] = [rules[k].turn_back for k in numbers]
    rows["window"] = [ticks(rules[k].left_time, periods[k]) for k in numbers]
    return rows


@jit
def find_margins(
    trials: Ints, frames: Ints, ego: Grid[EgoFrame], nets: Ints, tables: MarginTables, margins: Rows[EgoMargins]
) -> None:
    """Write the margins of some trials into `margins` (B,).

    Parameters
    ----------
    trials, frames : (K,)
        Numbers of the trials, and of frames that each has.
    ego : (B, F)
        The ego in each frame.
    nets : (B,)
        Number of each trial's road network.
    tables
        The tables of all trials; `signal` has room for the frames of any.
    margins : (B,)
        The margins, written in place.
    """
    for k in range(trials.shape[0]):
        b: int = trials[k]
        _find_margin(b, frames[k], ego[b], nets[b], tables, margins[b])


@jit
def _find_margin(b: int, frames: Any, ego: Rows[EgoFrame], net: Any, tables: MarginTables, margins: EgoMargins) -> None:
    roads, signal = tables.roads, tables.signal
    half_road = roads.half_width[net]
    begun = False
    line = INFINITE
    segment = 0
    farthest = -1.0
    for f in range(frames):
        here = ego[f]
        x, y, bits = here.x, here.y, here.bits
        if bits & FLAG.ON_ROAD != 0:
            begun = True
        # The nearest segment is no farther than the one of the frame before, so often none need be searched.
        if begun and distance2(roads, net, segment, x, y) > farthest:
            segment, square = nearest_segment(roads, net, x, y)
            farthest = max(farthest, square)
        right = -_beyond(b, here, net, tables)
        signal[f] = right if bits & FLAG.HEMMED == 0 else INFINITE
        if bits & FLAG.OVERTAKING == 0:
            line = min(line, right)
    margins.road = float(half_road) - sqrt(farthest) if begun else INFINITE
    margins.line = line
    margins.back = _least_of_greatest(signal, frames, tables.rules[b].window)
    margins.turn = _least_way_back(frames, ego, net, tables.rules[b].turn_back, roads)


@jit
def _least_way_back(frames: Any, ego: Rows[EgoFrame], net: Any, turn_back: float, roads: RoadTable) -> float:
    """Return the least distance, metres, by which the ego could have backed farther without turning round.

    It is negative, or 0, in a frame in which it turned; infinite without a lane state (docs/rules.md#lane-state).
    """
    least = INFINITE
    reference = 0.0
    before = -1
    overtook = False
    for f in range(frames):
        here = ego[f]
        lane = here.lane
        if lane >= 0:
            turned = here.bits & FLAG.TURNED != 0
            came = lane ^ 1 if turned else lane
            progress, _ = lane_coordinates(roads, net, came, here.x, here.y)
            if came != before or (not overtook and progress > reference):
                reference = progress
            least = min(least, turn_back - (reference - progress))
            if turned:
                reference, _ = lane_coordinates(roads, net, lane, here.x, here.y)
        before = lane
        overtook = here.bits & FLAG.OVERTAKING != 0
    return least


@jit
def _beyond(b: int, ego: EgoFrame, net: Any, tables: MarginTables) -> Any:
    """Return how far the body reaches over the line at which `left` changes, metres; -inf without lane state."""
    roads, cars, rules = tables.roads, tables.cars, tables.rules[b]
    lane = ego.lane
    if lane < 0:
        return -INFINITE
    tx, ty = lane_direction_at(roads, net, lane, ego.x, ego.y)
    body = Box(ego.x, ego.y, ego.c, ego.s, cars.half_length[b], cars.half_width[b], cars.rounding[b])
    half = half_extent(tx, ty, ego.c, ego.s, body)
    _, lateral = lane_coordinates(roads, net, lane, ego.x, ego.y)
    risen = ego.bits & FLAG.LEFT != 0
    return lateral + half - (rules.left_release if risen else rules.left_set)


@jit
def _least_of_greatest(signal: Floats, count: Any, window: Any) -> Any:
    """Return the least, over all frames, of the greatest value at the frame and up to `window` frames after it.

    Spans that the last frame cuts short count with the frames they have. A span can lower the least only if all of its
    values lie below it, so its greatest value is searched only then.
    """
    least = signal[count - 1]
    high = -1
    for f in range(count):
        if signal[f] >= least:
            high = f
        elif f - high > window:
            high = f - window
            for g in range(high + 1, f + 1):
                if signal[g] >= signal[high]:
                    high = g
            least = signal[high]
    return least


class Judged(Protocol):
    """What `margins_of` reads of a score (`scoring.score.Score`)."""

    @property
    def verdict(self) -> Verdict | None:
        """The verdict, None if the problem carries no rules."""
        ...

    @property
    def goals_visited(self) -> float:
        """Share of the goals that were visited."""
        ...


def entries_by_rule(margins: EntryMargins, period: float) -> dict[str, float | None]:
    """Return the margins of rule 3 by the rules' names, seconds, seconds and metres; None without an entry that counts.

    Parameters
    ----------
    margins
        The margins that the referee has found.
    period
        Seconds of a tick.
    """
    values = (margins.stop * period, margins.order * period, margins.clear)
    return {rule: value if math.isfinite(value) else None for rule, value in zip(ENTERED, values, strict=True)}


def margins_of(scores: Iterable[Judged]) -> Floats:
    """Return by how much the ego of each trial kept or broke each rule; a search minimises these.

    Parameters
    ----------
    scores
        Scores of trials whose problems carry rules.

    Returns
    -------
    (B, len(MARGINS)) float64
        Metres, or `UNITS`; infinite where nothing could break the rule. Negative exactly if the ego broke the rule;
        of liveness, exactly if a goal was not visited twice after frame 0, or a gap was too long.
    """
    return np.array([_row(score) for score in scores]).reshape(-1, len(MARGINS))


def _row(score: Judged) -> list[float]:
    verdict = score.verdict
    if verdict is None:
        return [math.inf] * len(MARGINS)
    broken = {violation.rule for violation in verdict.violations if violation.car == EGO_NAME}
    row: list[float] = []
    for rule in MARGINS[:-1]:
        value = verdict.robustness.get(rule)
        value = math.inf if value is None else value
        row.append(min(value, -SURE) if rule in broken else max(value, SURE))
    limit, gap = verdict.gap_limit_s, verdict.longest_gap_s
    spare = math.inf if limit is None or gap is None else limit - gap
    missed = not verdict.recurrent or spare < 0.0
    return [*row, min(spare, -SURE) if missed else max(spare, SURE)]


def margins_by_rule(gap: float | None, margins: Sequence[float]) -> dict[str, float | None]:
    """Return the margins by the rules' names, from the smallest gap (m) and the margins of `find_margins`, in order."""
    named = zip(MEASURED, margins, strict=True)
    return {"1.collision": gap} | {rule: value if math.isfinite(value) else None for rule, value in named}
