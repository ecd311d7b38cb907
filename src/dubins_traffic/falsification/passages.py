"""The ego's way through a trial in stretches: along a road, through a disc, and what it did there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from dubins_traffic.falsification.coverage import DEGREES, MANOEUVRES, Cell, Manoeuvre
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.verdict import EGO_RULES

OVER: Final = -2
"""Stands for the lane state after the end of a trial."""
BARRED: Final = 1 << 40
"""Beside the flags of `rules.propositions`: has come to a crossing that was not clear."""
STRAIGHT_WITHIN: Final = 0.5
"""Sine of the largest turn that still counts as going straight on, 30 degrees."""
TELLING: Final = (
    FLAG.LEFT | FLAG.OVERTAKING | FLAG.BLOCKED | FLAG.STOPPED | FLAG.AHEAD | FLAG.FIRST | FLAG.FORFEITED | FLAG.BREACH3
    | FLAG.EXCUSED | FLAG.TURNED | FLAG.LINGERS | FLAG.HEMMED | BARRED
)  # fmt: skip
"""The flags by which situations are told apart."""
MANOEUVRE_BIT, DEGREE_BIT = 44, 48
"""Where manoeuvre and degree stand in the number of a situation, above all flags."""
_AT_CROSSINGS: Final = ("3.stop", "3.order", "3.clear")


Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, slots=True)
class Passages:
    """The stretches of some trials, one row each, in order of trial and time."""

    trial: Ints
    """Shape (P,). Which of the trials."""
    first: Ints
    end: Ints
    """`first`, `end`: shape (P,). Its first frame, and the frame after its last."""
    manoeuvre: Ints
    degree: Ints
    """`manoeuvre`, `degree`: shape (P,). What the ego did, and how many roads meet in the disc, or in the one at the
    end of the road.
    """
    in_disc: Bools
    """Shape (P,). Whether it leads through a disc."""
    disc: Ints
    """Shape (P,). The intersection whose disc that is; -1 on roads, and for who has never left the disc."""
    flags: Ints
    """Shape (P,). The flags of `rules.propositions` that held of the ego in a frame of the stretch, and `BARRED`."""
    before: Ints
    """Shape (P,). The flags of the stretch before, 0 for the first one of a trial."""

    def cell(self, rule: str, trial: int, tick: int) -> Cell:
        """Return the cell of a breach of `rule` at a frame of a trial.

        A breach of rule 3 belongs to the way through the disc that the ego enters; its body meets a disc before its
        centre does.
        """
        last = int(np.searchsorted(self.trial, trial, side="right"))
        row = int(np.searchsorted(self.trial, trial, side="left"))
        while row + 1 < last and self.end[row] <= tick:
            row += 1
        if rule in _AT_CROSSINGS and not self.in_disc[row]:
            if row + 1 == last:
                return Cell(rule, Manoeuvre.ENTERING, int(self.degree[row]))
            row += 1
        return Cell(rule, Manoeuvre(int(self.manoeuvre[row])), int(self.degree[row]))

    def last(self, trial: int) -> int:
        """Return the last frame of a trial."""
        return int(self.end[np.searchsorted(self.trial, trial, side="right") - 1]) - 1

    def visits(self, trial: int, goals: frozenset[int]) -> list[int]:
        """Return the frames in which the ego comes into the disc of one of `goals`, from another disc or at first."""
        rows = np.flatnonzero((self.trial == trial) & self.in_disc)
        discs: list[int] = self.disc[rows].tolist()
        first: list[int] = self.first[rows].tolist()
        before = [-2, *discs][: len(discs)]
        return [tick for tick, disc, last in zip(first, discs, before, strict=True) if disc in goals and disc != last]

    def situations(self, trials: int) -> list[tuple[int, ...]]:
        """Return for each of `trials` trials the numbers of the situations in it, ascending.

        A situation is a stretch: its manoeuvre, degree, and which of the flags `TELLING` held in it.
        """
        number = self.flags & TELLING | self.manoeuvre << MANOEUVRE_BIT | self.degree << DEGREE_BIT
        ends: list[int] = np.searchsorted(self.trial, np.arange(trials + 1)).tolist()
        whole: list[int] = number.tolist()
        return [tuple(sorted(set(whole[a:b]))) for a, b in pairwise(ends)]

    def exercised(self, trials: int, crossing_degree: int) -> list[tuple[int, ...]]:
        """Return for each of `trials` trials which cells were put to the test: their numbers, each as often as it was.

        A cell is put to the test where it could have been broken: rule 3 by entering a crossing (a disc where
        `crossing_degree` roads meet, or more), its order and clearance only if somebody was before the ego or in the
        crossing; rule 2 by something that stands in the way; a collision needs somebody near.
        """
        seen, came = self.flags, self.before
        met = _held(came, FLAG.AHEAD | BARRED)
        blocked = _held(seen, FLAG.BLOCKED | FLAG.OVERTAKING)
        entered = self.in_disc & (self.manoeuvre != Manoeuvre.LEAVING) & (self.degree >= crossing_degree)
        tested: dict[str, Bools] = {
            "1.collision": np.where(self.in_disc, met, blocked | _held(seen, FLAG.AHEAD | BARRED)),
            "1.road": np.ones(len(seen), dtype=bool),
            "2.left": ~self.in_disc & (blocked | _held(seen, FLAG.LEFT)),
            "2.return": ~self.in_disc & _held(seen, FLAG.LEFT),
            "2.turn": ~self.in_disc,
            "3.stop": entered,
            "3.order": entered & _held(came, FLAG.AHEAD),
            "3.clear": entered & _held(came, BARRED),
        }
        within = self.manoeuvre * DEGREES + self.degree
        numbers = [EGO_RULES.index(rule) * MANOEUVRES * DEGREES + within[rows] for rule, rows in tested.items()]
        places = [self.trial[rows] for rows in tested.values()]
        number, trial = np.concatenate(numbers), np.concatenate(places)
        order = np.lexsort((number, trial))
        ends: list[int] = np.searchsorted(trial[order], np.arange(trials + 1)).tolist()
        whole: list[int] = number[order].tolist()
        return [tuple(whole[a:b]) for a, b in pairwise(ends)]


def find_passages(
    lane: Ints, bits: npt.NDArray[np.integer[Any]], frames: Ints, networks: Sequence[RoadNetwork]
) -> Passages:
    """Return the stretches of some trials.

    Parameters
    ----------
    lane : (K, F) int64
        Lane state of each ego in each frame, -1 for none.
    bits : (K, F)
        Its flags.
    frames : (K,)
        How many frames each trial has, at most F.
    networks : sequence of RoadNetwork
        That of each trial.
    """
    width: int = lane.shape[1]
    running: Bools = np.less(np.arange(width), frames[:, None])
    whole = np.where(running, lane, OVER)
    begins = np.ones(whole.shape, dtype=bool)
    begins[:, 1:] = whole[:, 1:] != whole[:, :-1]
    place = np.flatnonzero(begins)
    flags: Ints = bits.astype(np.int64)
    waits = _held(flags, FLAG.APPROACH | FLAG.STOPPED)
    flags |= np.where(waits & ~_held(flags, FLAG.CLEAR), BARRED, 0)
    held = np.bitwise_or.reduceat(flags.ravel(), place)
    ends = np.append(place[1:], whole.size)
    kept = whole.ravel()[place] != OVER
    place, held, ends = place[kept], held[kept], ends[kept]
    trial, first = place // width, place % width
    lane_of_stretch = whole.ravel()[place]
    ground = _ground(networks)
    manoeuvre, degree = _manoeuvres(trial, lane_of_stretch, held, ground)
    fresh = np.append(True, trial[1:] != trial[:-1])
    return Passages(
        trial,
        first,
        ends - trial * width,
        manoeuvre,
        degree,
        lane_of_stretch < 0,
        _discs(trial, lane_of_stretch, ground),
        held,
        np.where(fresh, 0, np.roll(held, 1)),
    )


@dataclass(frozen=True, slots=True)
class _Ground:
    """The roads of several trials, one network after another, and where those of each trial begin."""

    head: Ints
    """Degree of the intersection at the end of each lane."""
    tail: Ints
    """That of the intersection at its beginning."""
    into: Ints
    """The intersection at the end of each lane."""
    out_of: Ints
    """That at its beginning."""
    tangent: npt.NDArray[np.float64]
    base: Ints
    """Number of the first lane of each trial."""


def _ground(networks: Sequence[RoadNetwork]) -> _Ground:
    distinct = {id(network): network for network in networks}
    tables = [_lanes(network) for network in distinct.values()]
    sizes = np.cumsum([0, *(len(table[0]) for table in tables)])
    base = dict(zip(distinct, sizes.tolist(), strict=False))
    place = np.array([base[id(network)] for network in networks])
    head, tail, into, out_of, tangent = [np.concatenate(arrays) for arrays in zip(*tables, strict=True)]
    return _Ground(head, tail, into, out_of, tangent, place)


def _held(flags: Ints, wanted: int) -> Bools:
    """Tell of which stretches one of the flags `wanted` held."""
    return (flags & wanted) != 0


def _lanes(network: RoadNetwork) -> tuple[npt.NDArray[Any], ...]:
    """Return the first columns of `_Ground` for the lanes of a network; they are kept with it."""
    lanes = network.known.get(_LANES)
    if lanes is None:
        ends = network.degrees[network.ends]
        head = np.stack([ends[:, 1], ends[:, 0]], axis=1).ravel()
        tail = np.stack([ends[:, 0], ends[:, 1]], axis=1).ravel()
        tangent = np.stack([network.tangents, -network.tangents], axis=1).reshape(-1, 2)
        into, out_of = network.ends[:, ::-1].ravel(), network.ends.ravel()
        lanes = network.known[_LANES] = head, tail, into, out_of, tangent
    return lanes  # pyright: ignore[reportReturnType]  # what stands under our own key


_LANES = "falsify lanes"


def _discs(trial: Ints, lane: Ints, ground: _Ground) -> Ints:
    """Return through the disc of which intersection each stretch leads, -1 if through none, or if none is known."""
    came, goes = _neighbours(trial, lane)
    base = ground.base[trial]
    into = np.where(came >= 0, ground.into[np.maximum(came, 0) + base], -1)
    out_of = np.where(goes >= 0, ground.out_of[np.maximum(goes, 0) + base], -1)
    return np.where(lane < 0, np.where(into >= 0, into, out_of), -1)


def _neighbours(trial: Ints, lane: Ints) -> tuple[Ints, Ints]:
    """Return the lane states of the stretches before and after each one of the same trial, -1 for none."""
    same = trial[1:] == trial[:-1]
    came = np.append(-1, np.where(same, lane[:-1], -1))
    goes = np.append(np.where(same, lane[1:], -1), -1)
    return came, goes


def _manoeuvres(trial: Ints, lane: Ints, flags: Ints, ground: _Ground) -> tuple[Ints, Ints]:
    """Return manoeuvre and degree of each stretch."""
    came, goes = _neighbours(trial, lane)
    base = ground.base[trial]
    before, after, present = (np.where(which < 0, 0, which) + base for which in (came, goes, lane))
    t0, t1 = ground.tangent[before], ground.tangent[after]
    sine = t0[:, 0] * t1[:, 1] - t0[:, 1] * t1[:, 0]
    ahead = t0[:, 0] * t1[:, 0] + t0[:, 1] * t1[:, 1] > 0.0
    through = np.select(
        [came < 0, goes < 0, goes == came ^ 1, ahead & (np.abs(sine) <= STRAIGHT_WITHIN), sine > 0.0],
        [Manoeuvre.LEAVING, Manoeuvre.ENTERING, Manoeuvre.BACK, Manoeuvre.STRAIGHT, Manoeuvre.LEFT],
        Manoeuvre.RIGHT,
    )
    along = np.select(
        [_held(flags, FLAG.OVERTAKING), _held(flags, FLAG.TURNED)],
        [Manoeuvre.OVERTAKING, Manoeuvre.TURNED],
        Manoeuvre.DRIVING,
    )
    in_disc = lane < 0
    degree = np.where(in_disc, np.where(came >= 0, ground.head[before], ground.tail[after]), ground.head[present])
    unknown = in_disc & (came < 0) & (goes < 0)
    return np.where(in_disc, through, along), np.where(unknown, 0, degree)
