"""The ranking of a phase: means with intervals, what parts equal ones, and which places are ties."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any, Final, TypeAlias

import numpy as np

from dubins_traffic.campaign.columns import SCORES, SECOND
from dubins_traffic.campaign.report.comparison import Difference
from dubins_traffic.campaign.report.statistics import Estimate, Interval, Share, estimate, share
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.judging import OWNERS, Judged
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.protocols import End
from dubins_traffic.scoring.icra2016 import COLLISION_SCORE
from dubins_traffic.scoring.verdict import Ruling, was_cut

Result: TypeAlias = Judged | Mapping[str, Any]
"""What came of a trial, or its row alone."""
PLATFORM: Final = frozenset(end for end, owner in OWNERS.items() if owner == "platform")


@dataclass(frozen=True, slots=True)
class RankedEntry:
    """The place of one entry."""

    place: int
    """From 1; entries that nothing parts share one, and the next is as much lower."""
    entry: str
    """Whose it is."""
    trials: int
    """How many trials it rests on."""
    estimate: Estimate
    """Mean of the metric over the trials, with its 95 % interval."""
    second: float
    """Mean of the rounds before the first breach, which parts entries of equal means."""
    satisfied: Share
    clean: Share
    """`satisfied`, `clean`: of the trials, with Wilson's intervals: satisfied to the end; nothing broken, of those
    that were not cut.
    """
    cut: int
    """Trials that others ended before the ego broke anything (docs/rules.md#cut); they count as all do in
    `estimate`.
    """
    ties: tuple[str, ...]
    """The other entries from which it can't be told: the interval of the paired differences holds 0."""
    to_next: Estimate | None
    """By how much it exceeds the next lower place, trial by trial; None for the lowest."""

    def to_json(self) -> dict[str, Any]:
        """Return the place as a JSON object."""
        return {
            "place": self.place,
            "entry": self.entry,
            "trials": self.trials,
            "mean": self.estimate.mean,
            "interval": _ends(self.estimate.mean_interval),
            SECOND: self.second,
            "satisfied": self.satisfied.share,
            "satisfied_interval": _ends(self.satisfied.interval),
            "clean": self.clean.share,
            "cut": self.cut,
            "ties": list(self.ties),
            "to_next": None if self.to_next is None else self.to_next.mean,
            "to_next_interval": None if self.to_next is None else _ends(self.to_next.mean_interval),
        }


@dataclass(frozen=True, slots=True)
class _Entry:
    name: str
    values: Floats
    mean: float
    second: float
    satisfied: int
    clean: int
    cut: int


def rank(entries: Mapping[str, Sequence[Result]], phase: Phase) -> list[RankedEntry]:
    """Rank entries by what they did in the same trials.

    Parameters
    ----------
    entries : Mapping
        What came of all trials of the phase for each entry, in any order.

    Returns
    -------
    list of RankedEntry
        Best first; entries on one place in the order of their names.

    Raises
    ------
    InputError
        If an entry lacks a trial, has one twice, or one that ended by a fault of the platform and must run again.
    """
    ranked = sorted(
        (_entry(name, results, phase) for name, results in sorted(entries.items())),
        key=lambda entry: _merit(entry, phase),
        reverse=True,
    )
    apart = {(one.first, one.second): one for one in _differences(ranked, phase)}
    places: list[RankedEntry] = []
    for k, entry in enumerate(ranked):
        equal = k > 0 and _merit(entry, phase) == _merit(ranked[k - 1], phase)
        beside = [
            (one.second if one.first == entry.name else one.first)
            for one in apart.values()
            if entry.name in (one.first, one.second) and holds_zero(one.estimate)
        ]
        following = apart[entry.name, ranked[k + 1].name].estimate if k + 1 < len(ranked) else None
        count = len(entry.values)
        places.append(
            RankedEntry(
                places[-1].place if equal else k + 1,
                entry.name,
                count,
                _estimated(entry.values.tobytes()),
                entry.second,
                share(entry.satisfied, count),
                share(entry.clean, count - entry.cut),
                entry.cut,
                tuple(sorted(beside)),
                following,
            )
        )
    return places


def differences(entries: Mapping[str, Sequence[Result]], phase: Phase) -> list[Difference]:
    """Return by how much each entry exceeds each other one, trial by trial; the errors are those of `rank`."""
    return _differences([_entry(name, results, phase) for name, results in entries.items()], phase)


def ranking_document(entries: Mapping[str, Sequence[Result]], phase: Phase) -> dict[str, Any]:
    """Return places and paired differences as a JSON object; the errors are those of `rank`."""
    return {
        "phase": phase.name,
        "metric": phase.ranking.metric,
        "places": [place.to_json() for place in rank(entries, phase)],
        "differences": [
            {
                "first": difference.first,
                "second": difference.second,
                "mean": difference.estimate.mean,
                "interval": _ends(difference.estimate.mean_interval),
                "first_larger": difference.larger,
                "first_smaller": difference.smaller,
            }
            for difference in differences(entries, phase)
        ],
    }


def missing(results: Sequence[Result], phase: Phase) -> list[int]:
    """Return the numbers of the trials of a phase of which there is no result yet, in order."""
    there = {row["number"] for row in map(_row, results) if row["end"] not in PLATFORM}
    return [number for number in phase.numbers if number not in there]


def value(row: Mapping[str, Any], metric: str) -> float:
    """Return what a trial counts in a ranking.

    Norm: docs/rules.md#ranking.
    """
    score = row[metric]
    if metric == "icra2016" and (score is None or row["end"] != End.DURATION):
        return COLLISION_SCORE
    return 0.0 if score is None else float(score)


def is_satisfied(row: Mapping[str, Any]) -> bool:
    """Tell whether a trial ran its whole duration and satisfied its task."""
    return row["verdict"] == Ruling.SATISFIED and row["end"] == End.DURATION


def is_clean(row: Mapping[str, Any]) -> bool:
    """Tell whether a trial ran its whole duration and the ego broke nothing."""
    clean = row["clean"] if row["clean"] is not None else not row["collisions"]
    return bool(clean) and row["end"] == End.DURATION


def is_cut(row: Mapping[str, Any]) -> bool:
    """Tell whether others ended a trial before the ego broke anything."""
    return was_cut(row["verdict"], row["clean"], row["end"])


def holds_zero(difference: Estimate) -> bool:
    """Tell whether differences are none that could be told from nothing; one difference alone tells nothing."""
    return (
        difference.count < 2
        or difference.mean_interval is None
        or difference.mean_interval[0] <= 0.0 <= difference.mean_interval[1]
    )


def _entry(name: str, results: Sequence[Result], phase: Phase) -> _Entry:
    rows = sorted((_row(result) for result in results), key=lambda row: row["number"])
    numbers = [row["number"] for row in rows]
    left = missing(results, phase)
    if left or numbers != list(phase.numbers):
        raise InputError(
            "not one result of each trial",
            field=name,
            value=left[:10] if left else numbers[:10],
            expected=f"the {len(phase.numbers)} trials of phase {phase.name}, none ended by the platform",
        )
    values = np.array([value(row, phase.ranking.metric) for row in rows], dtype=np.float64)
    mean = float(np.sum(values)) / len(values)
    second = math.fsum(value(row, SECOND) for row in rows) / len(rows)
    counts = (sum(map(holds, rows)) for holds in (is_satisfied, is_clean, is_cut))
    return _Entry(name, values, mean, second, *counts)


def _merit(entry: _Entry, phase: Phase) -> tuple[float, float, int]:
    second = entry.second if phase.ranking.metric == "counted_rounds" else 0.0
    return entry.mean, second, entry.satisfied if phase.ranking.ties == "satisfied" else 0


def _differences(entries: Sequence[_Entry], phase: Phase) -> list[Difference]:
    column = SCORES[phase.ranking.metric].column
    made: list[Difference] = []
    for one, other in combinations(entries, 2):
        apart = one.values - other.values
        larger, smaller = int((apart > 0).sum()), int((apart < 0).sum())
        made.append(Difference(one.name, other.name, column, _estimated(apart.tobytes()), larger, smaller))
    return made


@lru_cache(maxsize=1 << 14)
def _estimated(values: bytes) -> Estimate:
    """Return the estimate for values: most pairs are as they were when a table is made anew."""
    return estimate(np.frombuffer(values), median=False)


def _row(result: Result) -> Mapping[str, Any]:
    return result.row if isinstance(result, Judged) else result


def _ends(interval: Interval | None) -> list[float] | None:
    return None if interval is None else list(interval)
