"""How `rules` does among `lawful` cars on maps that come with SUMO.

    python -m experiments towns
    python -m experiments.towns [TRIALS] [JOBS] [FIRST]

Each map is imported from SUMO's own file, which `scripts/peers.sh sumo` installs if it is missing. Each trial is 300 s
with 1 to 4 goals. In the two largest towns with one lane in each direction the goals lie anywhere, and the e-agents are
`lawful` ones that wander or go between places: a sixteenth to a fourth as many as the town has lanes. On ten maps the
goals are within reach (`goal_round_share`), and an eighth as many `lawful` cars as the map has lanes wander.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from benchmarks.table import Row, show

from dubins_traffic.files import read_text
from dubins_traffic.kernels.philox import Draws
from dubins_traffic.maps.reduction import Reduction
from dubins_traffic.maps.sumo import SumoNet
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial

ROOT = Path(__file__).resolve().parents[1]
ENVIRONMENTS = (ROOT / "build" / "crosscheck" / "sumo", ROOT / "build" / "peers" / "sumo")
GAMES = "lib/python*/site-packages/sumo/tools/game"
TOWNS = {"DRT": "DRT/osm.net.xml", "bs3d": "bs3d/bs.net.xml"}
"""Files below `tools/game`."""
MAPS = {
    **TOWNS,
    "A10KW": "A10KW/osm.net.xml",
    "corridor": "corridor/corridor.net.xml",
    "fokr_bs": "fokr_bs_demo/fokr_bs.net.xml.gz",
    "grid6": "grid6/grid6.net.xml",
    "hiking": "hiking/hiking.net.xml",
    "kuehne": "kuehne/kuehne.net.xml",
    "ramp": "ramp/ramp.net.xml",
    "square": "square/square.net.xml",
}
"""Files of the ten maps likewise."""
WITHIN = {"goal_round_share": 0.4}
ON_EACH, ENOUGH = 10, 8
"""Trials on each of the ten maps, and in how many of them `rules` is to make counted rounds."""
DURATION = 300.0
TRIALS = 100
SEED = 2016


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial: breaches of the ego and of the others as "rule car since-time", collisions, metres driven, rounds."""

    town: str
    number: int
    agents: int
    own: tuple[str, ...]
    others: tuple[str, ...]
    collisions: int
    distance: float
    rounds: int
    counted: int

    @property
    def clean(self) -> bool:
        """Whether nobody broke anything, and nobody touched anybody."""
        return not self.own and not self.others and not self.collisions


def games() -> Path | None:
    """Return the folder of SUMO's own games, of which the towns are parts; None where SUMO is not installed."""
    return next((found for at in ENVIRONMENTS for found in at.glob(GAMES)), None)


def text_of(town: str) -> str:
    """Return SUMO's own file of a map."""
    folder = games()
    if folder is None:
        raise SystemExit("experiments: SUMO is not installed; scripts/peers.sh sumo says why")
    return read_text(str(folder / MAPS[town]))


@cache
def reduced(town: str) -> Reduction:
    """Return the network to which a town is reduced, and what is lost."""
    return SumoNet().reduced(text_of(town))


def roads(town: str) -> dict[str, Any]:
    """Return the document of the network to which a town is reduced."""
    return dict(reduced(town).document)


@cache
def lanes(town: str) -> int:
    """Return how many lanes a town has."""
    return RoadNetwork.from_document(roads(town)).lanes


def instance(town: str, number: int, seconds: float = DURATION) -> Instance:
    """Return the random instance of a number, with goals anywhere."""
    draws = Draws(SEED, number, 919)
    goes = ("wander", "places")[draws.below(2)]
    count = draws.between(lanes(town) // 16, lanes(town) // 4)
    return _drawn(town, number, seconds, count, goes)


def within_reach(town: str, number: int, seconds: float = DURATION) -> Instance:
    """Return the random instance of a number, with goals within reach."""
    return _drawn(town, number, seconds, max(1, lanes(town) // 8), "wander", **WITHIN)


def _drawn(town: str, number: int, seconds: float, count: int, goes: str, **more: Any) -> Instance:
    agents = [{"type": "lawful", "name": f"car{k}", "parameters": {"goes": goes}} for k in range(count)]
    configuration = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": roads(town),
        "e-agents": agents,
        "number_trials": 1,
        "duration": seconds,
        "number_goals_bounds": [1, 4],
        "rules": True,
    }
    return draw(load_config(configuration | more), SEED, number)


def drive(number: int, town: str, seconds: float = DURATION, drawn: Callable[..., Instance] = instance) -> Drive:
    """Run `rules` on an instance."""
    own = drawn(town, number, seconds)
    score = run_trial(own, "rules").score
    verdict = score.verdict
    assert verdict is not None
    told = [(one.car, f"{one.rule} {one.car} {one.since:.2f}-{one.time:.2f}") for one in verdict.violations]
    return Drive(
        town,
        number,
        len(own.e_agents),
        tuple(words for car, words in told if car == "ego"),
        tuple(words for car, words in told if car != "ego"),
        len(score.collisions) + score.collisions_among_others,
        score.driven.distance_m,
        score.rounds,
        score.counted_rounds,
    )


def bars(found: Sequence[Drive]) -> list[Row]:
    """Return the table of the bars."""
    rows: list[Row] = []
    for town in TOWNS:
        own = [one for one in found if one.town == town]
        if not own:
            continue
        trials = f"{town}, {len(own)} trials among {min(d.agents for d in own)} to {max(d.agents for d in own)} cars"
        counts = {
            "the ego is not clean": sum(1 for one in own if one.own),
            "in which e-agents break a rule": sum(1 for one in own if one.others),
            "in which cars touch": sum(1 for one in own if one.collisions),
        }
        rows += [Row(f"{trials}: {what}", str(count), "0", count == 0) for what, count in counts.items()]
        distance = sum(one.distance for one in own) / len(own)
        rows.append(Row(f"{trials}: metres driven by the ego", f"{distance:.0f}", "", True))
    return rows


def reached(found: Sequence[Drive]) -> list[Row]:
    """Return the table of the ten maps."""
    rows: list[Row] = []
    for town in MAPS:
        own = [one for one in found if one.town == town]
        if own:
            counted = sum(1 for one in own if one.counted)
            agents, enough = own[0].agents, ENOUGH * len(own) / ON_EACH
            says = f"{town}, goals within reach, {len(own)} trials among {agents} cars: with counted rounds"
            rows.append(Row(says, str(counted), f">= {enough:g}", counted >= enough))
    return rows


def trials(
    towns: Iterable[str], numbers: Iterable[int], jobs: int, drawn: Callable[..., Instance] = instance
) -> list[Drive]:
    """Run the trials of some numbers on each map, in `jobs` processes, and print those that are not clean."""
    found: list[Drive] = []
    with ProcessPoolExecutor(jobs) as pool:
        for town in towns:
            for one in pool.map(partial(drive, town=town, drawn=drawn), numbers):
                found.append(one)
                if not one.clean:
                    print(one, flush=True)
    return found


def table(count: int = TRIALS, jobs: int = 2, first: int = 0) -> list[Row]:
    """Run `count` trials in each town, and those on the ten maps; return the table of the bars."""
    anywhere = trials(TOWNS, range(first, first + count), jobs)
    return bars(anywhere) + reached(trials(MAPS, range(ON_EACH), jobs, within_reach))


def measure() -> list[Row]:
    """Run all trials and return the table of the bars."""
    if games() is None:
        subprocess.run([str(ROOT / "scripts" / "peers.sh"), "sumo"], check=True)
    return table()


def main() -> None:
    """Print what is remarkable, and the table."""
    show("towns", table(*(int(argument) for argument in sys.argv[1:4])))


if __name__ == "__main__":
    main()
