"""The worst trials of a campaign, run again and replayed: the same seed gives the same bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.chunks import Chunk
from dubins_traffic.campaign.report.comparison import number_of, words
from dubins_traffic.campaign.table import FACTOR, places
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.record import reader
from dubins_traffic.record.sink import FAULTS, End
from dubins_traffic.scoring.metric import Column
from dubins_traffic.scoring.score import score
from dubins_traffic.viewer.replay import write_replay

FOLDER = "replays"
SUMMARY = (
    "end",
    "clean",
    "counted_rounds",
    "verdict",
    "rounds",
    "goals_visited",
    "collisions",
    "collisions_ego_fault",
    "breaches",
    "distance_m",
    "min_clearance_m",
    "paper_score",
    "icra2016",
)
"""Columns shown beside a replay."""

OTHER_WAY = "went another way when it was run again"


@dataclass(frozen=True, slots=True)
class Bad:
    """One of the worst trials: its row, why it is bad, its replay (None: there is none), and a remark on it."""

    row: Mapping[str, Any]
    why: str
    replay: str | None
    note: str

    @property
    def factors(self) -> list[str]:
        """What varied, with its values, in words."""
        settings = {name.removeprefix(FACTOR): value for name, value in self.row.items() if name.startswith(FACTOR)}
        return [f"{words(name)} {value}" for name, value in settings.items()]


def order(results: Any) -> Ints:
    """Return the rows of a table in the order of how bad the trials are, the worst first.

    In order: came to nothing; ended by a fault; collisions with the ego at fault; breaches of the ego; other
    collisions; few counted rounds; few goals visited; few rounds; the number of the trial.
    """
    compute: Any = rows.arrow().compute

    def among(values: Iterable[str]) -> Ints:
        chosen = compute.is_in(results["end"], rows.arrow().array(sorted(values), rows.arrow().string()))
        return chosen.cast("int64").to_numpy(zero_copy_only=False)

    def number(column: str) -> Floats:
        return compute.fill_null(results[column].cast("float64"), 0.0).to_numpy(zero_copy_only=False)

    keys = (
        -among(rows.NOTHING),
        -among(FAULTS),
        -(number("collisions_ego_fault") + number("collisions_both_fault")),
        -number("breaches"),
        -number("collisions"),
        number("counted_rounds"),
        number("goals_visited"),
        number("rounds"),
        number("number"),
    )
    return np.lexsort(keys[::-1])


def why(row: Mapping[str, Any]) -> str:
    """Return in words why a trial is among the worst."""
    if row["reason"]:
        return f"{row['end'].replace('_', ' ')}: {row['reason']}"
    reasons: list[str] = []
    at_fault = (row["collisions_ego_fault"] or 0) + (row["collisions_both_fault"] or 0)
    if row["collisions"]:
        reasons.append(f"{number_of(row['collisions'], 'collision')}, {at_fault} with the ego at fault")
    if row["breaches"]:
        reasons.append(f"{number_of(row['breaches'], 'breach', 'breaches')}, {row['verdict']}")
    if not reasons:
        whole = "" if row["end"] == End.DURATION else f", {words(row['end'])} after {row['duration_s']:.1f} s"
        kept, rounds = row["counted_rounds"], row["rounds"]
        some = number_of(rounds, "round") if kept == rounds else f"{kept} of {rounds} rounds count"
        reasons.append(f"{row['goals_visited']:.0%} of the goals visited, {some}{whole}")
    return "; ".join(reasons)


def worst(
    campaign: Campaign,
    results: Any,
    controllers: Sequence[str],
    count: int,
    folder: Path,
    tell: Callable[[int, int], object],
) -> dict[str, list[Bad]]:
    """Return the `count` worst trials of each of `controllers`, with their replays written into `folder`.

    A trial that came to nothing is not run again. `tell` is told how many of how many replays there are.
    """
    compute: Any = rows.arrow().compute
    chosen = {name: _first(results.filter(compute.equal(results["controller"], name)), count) for name in controllers}
    total = sum(map(len, chosen.values()))
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    by_controller: dict[str, list[Bad]] = {}
    done = 0
    for name, found_rows in chosen.items():
        by_controller[name] = []
        for row in found_rows:
            tell(done, total)
            by_controller[name].append(_bad(campaign, row, folder))
            done += 1
    return by_controller


def _first(trials: Any, count: int) -> list[Mapping[str, Any]]:
    return trials.take(rows.arrow().array(order(trials)[:count])).to_pylist()


def _bad(campaign: Campaign, row: Mapping[str, Any], folder: Path) -> Bad:
    if row["end"] in rows.NOTHING:
        return Bad(row, why(row), None, "not run again")
    name = replay_name(row["number"])
    try:
        again = replay(campaign, row, folder / name)
    except DubinsTrafficError as error:
        return Bad(row, why(row), None, str(error))
    return Bad(row, why(row), name, "" if same(row, again, campaign.columns) else OTHER_WAY)


def replay_name(number: int) -> str:
    """Return the path of a trial's replay within a report."""
    return f"{FOLDER}/trial-{number:09d}.html"


def same(row: Mapping[str, Any], again: Mapping[str, Any], metrics: Sequence[Column] = ()) -> bool:
    """Tell whether a trial that was run again went as it did, by the columns of further metrics, too."""
    return all(row[column] == again[column] for column in rows.results(metrics))


def _chunk(campaign: Campaign, number: int) -> Chunk:
    cells, controllers, trials = places(campaign, np.array([number]))
    return campaign.chunk(campaign.cells[int(cells[0])], int(controllers[0]), int(trials[0]))


def replay(campaign: Campaign, row: Mapping[str, Any], page: Path) -> rows.Row:
    """Run the trial of a row again, write its replay, and return its new row."""
    chunk = _chunk(campaign, row["number"])
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        result = chunk.job(0, record).run()
        there = reader.read(record)
    verdict = score(there).verdict
    summary = {"controller": row["controller"], **{name: row[name] for name in SUMMARY}}
    write_replay(page, there.instance, there.frames, there.ending, summary, verdict=verdict, overwrite=True)
    return rows.row(chunk.number, result.ending, result.score, result.wall.act_s)
