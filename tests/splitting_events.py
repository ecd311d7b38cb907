"""Events for the test of splitting's intervals, and their probabilities, counted by Monte Carlo.

    python -m tests.splitting_events TRIALS NAME...

counts the events of the traffic named in TRIALS trials, a multiple of ten, and writes what it finds into
`splitting_truths.json` beside this module. Traffic differs in where chance lies: `corridor` in one exit of three at
each crossing, `noise` in the speeds of cars at every tick, `starts` mostly in where the cars begin, so that little is
left to chance once a trial runs.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from dubins_traffic.campaign.report.statistics import clopper_pearson
from dubins_traffic.engine.group import Group
from dubins_traffic.falsification.estimate import Replicas, combined
from dubins_traffic.falsification.sampling import STREAM, prepared
from dubins_traffic.falsification.splitting import MeasuredGroup, split
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw_many
from dubins_traffic.problem.instance import Instance
from tests.falsifying import NEAR, corridor
from tests.minute import a_minute

TRUTHS: Final = Path(__file__).with_name("splitting_truths.json")
RULE: Final = "1.collision"
SEED: Final = 20_261_123
"""Of the trials that are counted; the tests of the intervals draw from other seeds."""
TOGETHER: Final = 4_000
SHARED: Final = 10
RUNS: Final = 10
PARTICLES: Final = 50
AWAY: Final = {f"assume_e{k}": 0 for k in range(1, 7)}
"""No part of the assumption is made, so Monte Carlo discards no trial."""


@dataclass(frozen=True, slots=True)
class Traffic:
    """Trials, and events in them: the clearance of the ego gets to so many metres or less.

    Attributes
    ----------
    name : str
        What the file of truths calls it.
    configuration : Configuration
        What its trials are drawn from.
    below : tuple of float
        Metres, one for each event.
    keeps_rules : bool
        Whether the ego is `rules`; else it stands.
    alike : bool
        Whether its trials differ in their seeds only.
    """

    name: str
    configuration: Configuration
    below: tuple[float, ...]
    keeps_rules: bool
    alike: bool

    def begin(self, instances: Sequence[Instance]) -> MeasuredGroup:
        """Begin trials of instances."""
        return MeasuredGroup(Group(instances, keeps_rules=self.keeps_rules), RULE)


def probability(own: Traffic, below: float) -> float | None:
    """Return the probability of an event, as counted; None if it is not in the file."""
    return truths().get(f"{own.name} {below:g}", {}).get("probability")


def traffic() -> tuple[Traffic, ...]:
    """Return all traffic, and the thresholds of its events."""
    bold = {"ego_range": 0.3, "stop_range": 0.2}
    arms = (("west", [4.0, 5.8, 0.0]), ("east", [8.2, 6.2, 3.14159]))
    wanderers = [{"type": "wander", "name": "car", "count": 3, "parameters": bold}]
    fixed = {"goals": [[0, 1], [2, 1]], "ego": {"start": [5.8, 8.0, -1.570795]}}
    return (
        Traffic("corridor", _changed(corridor(6), rate=10), (NEAR,), keeps_rules=False, alike=True),
        Traffic(
            "noise",
            _junction(_nudged(arms, "lawful", {}), **fixed),
            (0.006, 0.0166),
            keeps_rules=True,
            alike=True,
        ),
        Traffic("starts", _junction(wanderers), (0.055,), keeps_rules=True, alike=False),
    )


def _nudged(arms: Sequence[tuple[str, list[float]]], kind: str, parameters: dict[str, Any]) -> list[dict[str, Any]]:
    """Return e-agents of a kind with much noise on their speeds, with their names and starts."""
    own = {"kind": kind, "parameters": parameters, "speed_noise": 0.9, "delay": 1}
    return [{"type": "nudged", "name": name, "start": start, "parameters": own} for name, start in arms]


def _junction(agents: list[dict[str, Any]], **more: Any) -> Configuration:
    """Return trials of eight seconds on `junction` with other e-agents."""
    changed = {"e-agents": agents, "rules": AWAY, "rate": 10, **more}
    return prepared(_changed(a_minute("junction"), **changed), 8.0, {})


def _changed(configuration: Configuration, **more: Any) -> Configuration:
    document = configuration.to_document()
    if "goals" in more:
        document.pop("number_goals_bounds")
    return Configuration.from_document({**document, **more})


def count(own: Traffic, trials: int) -> list[int]:
    """Return in how many trials each event happens.

    Trials that differ in their seeds only are forks of trials at their first frames, `SHARED` of each, since these cost
    less than trials that are begun. They share what is drawn before the first tick, such as the first exits, and so
    are as good as independent: the share of the variance that lies between different beginnings is some times the
    probability of the event.
    """
    seeds, shared = np.random.default_rng(SEED), SHARED if own.alike else 1
    happened = [0] * len(own.below)
    done = 0
    while done < trials:
        begun = -(-min(TOGETHER, trials - done) // shared)
        company = own.begin(list(draw_many(own.configuration, SEED, range(done, done + begun))))
        if own.alike:
            drawn: list[int] = seeds.integers(0, 1 << 63, size=begun * shared).tolist()
            company = company.fork([k for k in range(begun) for _ in range(shared)])
            company.reseed(drawn)
        company.advance(company.group.instances[0].ticks)
        margins, done = company.margins(), done + begun * shared
        happened = [before + int((margins <= below).sum()) for before, below in zip(happened, own.below, strict=True)]
        print(f"{own.name}: {happened} of {done}", file=sys.stderr)
    return happened


def estimates(own: Traffic, below: float, seeds: Sequence[int]) -> list[Replicas]:
    """Return for each seed what `estimate` gives on an event with 10 runs of 50 particles."""
    instances = [drawn for seed in seeds for drawn in draw_many(own.configuration, seed, range(RUNS * PARTICLES))]
    dice = [np.random.default_rng([STREAM, seed, run, 1]) for seed in seeds for run in range(RUNS)]
    runs = split(instances, own.begin, below, dice)
    return [combined(runs[k : k + RUNS], PARTICLES) for k in range(0, len(runs), RUNS)]


def truths() -> dict[str, Any]:
    """Return what has been counted, by traffic and threshold."""
    return json.loads(TRUTHS.read_text(encoding="utf-8")) if TRUTHS.exists() else {}


def main(trials: int, names: Sequence[str]) -> None:
    """Count events and write the file."""
    for own in traffic():
        if own.name not in names:
            continue
        found = truths()
        for below, happened in zip(own.below, count(own, trials), strict=True):
            found[f"{own.name} {below:g}"] = {
                "command": f"python -m tests.splitting_events {trials} {own.name}", "trials": trials,
                "events": happened, "probability": happened / trials,
                "interval": clopper_pearson(happened, trials),
            }  # fmt: skip
        TRUTHS.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2:])
