"""The worst trials of a campaign, run again and replayed: the same seed gives the same bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.chunks import Chunk
from dubins_traffic.campaign.many import Job
from dubins_traffic.campaign.table import places
from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.record import reader
from dubins_traffic.record.sink import FAULTS
from dubins_traffic.scoring.score import score
from dubins_traffic.viewer.replay import write_replay

FOLDER = "replays"
SUMMARY = (
    "end",
    "verdict",
    "rounds",
    "goals_visited",
    "collisions",
    "collisions_ego_fault",
    "breaches",
    "distance_m",
    "min_clearance_m",
    "icra2016",
)
"""Columns shown beside a replay."""

NOTHING = frozenset({rows.FAILED, rows.CRASHED})
"""Ends of trials that came to nothing."""


@dataclass(frozen=True, slots=True)
class Bad:
    """One of the worst trials: its row, why it is, its replay (None: there is none), and what is odd about it."""

    row: Mapping[str, Any]
    why: str
    replay: str | None
    note: str


def order(results: Any) -> Ints:
    """Return the rows of a table in the order of how bad the trials are, the worst first.

    In order: came to nothing; ended by a fault; collisions with the ego at fault; a verdict of violated; breaches
    of the ego; other collisions; few goals visited; few rounds; the number of the trial.
    """
    compute: Any = rows.arrow().compute

    def among(column: str, values: Iterable[str]) -> Ints:
        found = compute.is_in(results[column], rows.arrow().array(sorted(values), rows.arrow().string()))
        return found.cast("int64").to_numpy(zero_copy_only=False)

    def number(column: str) -> Floats:
        return compute.fill_null(results[column].cast("float64"), 0.0).to_numpy(zero_copy_only=False)

    keys = (
        -among("end", NOTHING),
        -among("end", FAULTS),
        -(number("collisions_ego_fault") + number("collisions_both_fault")),
        -among("verdict", ["violated"]),
        -number("breaches"),
        -number("collisions"),
        number("goals_visited"),
        number("rounds"),
        number("number"),
    )
    return np.lexsort(keys[::-1])


def why(row: Mapping[str, Any]) -> str:
    """Return in words why a trial is among the worst."""
    if row["reason"]:
        return f"{row['end'].replace('_', ' ')}: {row['reason']}"
    found: list[str] = []
    at_fault = (row["collisions_ego_fault"] or 0) + (row["collisions_both_fault"] or 0)
    if row["collisions"]:
        found.append(f"{row['collisions']} collisions, {at_fault} with the ego at fault")
    if row["breaches"]:
        found.append(f"{row['breaches']} breaches, {row['verdict']}")
    if not found:
        found.append(f"{row['goals_visited']:.0%} of the goals visited, {row['rounds']} rounds")
    return "; ".join(found)


def worst(
    campaign: Campaign, results: Any, count: int, folder: Path, tell: Callable[[int, int], object]
) -> dict[str, list[Bad]]:
    """Return the `count` worst trials of each controller, with their replays written into `folder`.

    A trial that came to nothing is not run again. `tell` is told how many of how many replays there are.
    """
    compute: Any = rows.arrow().compute
    chosen = {
        name: _first(results.filter(compute.equal(results["controller"], name)), count)
        for name in campaign.controllers
    }
    total = sum(map(len, chosen.values()))
    (folder / FOLDER).mkdir(parents=True, exist_ok=True)
    found: dict[str, list[Bad]] = {}
    done = 0
    for name, own in chosen.items():
        found[name] = []
        for row in own:
            tell(done, total)
            found[name].append(_bad(campaign, row, folder))
            done += 1
    return found


def _first(own: Any, count: int) -> list[Mapping[str, Any]]:
    return own.take(rows.arrow().array(order(own)[:count])).to_pylist()


def _bad(campaign: Campaign, row: Mapping[str, Any], folder: Path) -> Bad:
    if row["end"] in NOTHING:
        return Bad(row, why(row), None, "not run again")
    name = f"{FOLDER}/trial-{row['number']:09d}.html"
    try:
        again = _replay(_chunk(campaign, row["number"]), row, folder / name)
    except DubinsTrafficError as error:
        return Bad(row, why(row), None, str(error))
    same = all(row[column] == again[column] for column in rows.RESULT)
    return Bad(row, why(row), name, "" if same else "went another way when it was run again")


def _chunk(campaign: Campaign, number: int) -> Chunk:
    cells, controllers, trials = places(campaign, np.array([number]))
    return campaign.chunk(campaign.cells[int(cells[0])], int(controllers[0]), int(trials[0]))


def _replay(chunk: Chunk, row: Mapping[str, Any], page: Path) -> rows.Row:
    """Run a trial again, write its replay, and return its row."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder) / "trial.mcap"
        job = Job(
            chunk.trial,
            chunk.seed,
            chunk.controller,
            configuration=chunk.configuration,
            record=record,
            deadline=chunk.deadline,
        )
        result = job.run()
        found = reader.read(record)
    verdict = score(found).verdict
    summary = {"controller": row["controller"], **{name: row[name] for name in SUMMARY}}
    write_replay(page, found.instance, found.frames, found.ending, summary, verdict=verdict)
    return rows.row(chunk.number, result.ending, result.score, result.wall.act_s)
