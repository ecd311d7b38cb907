"""Searches for what the mutants of `rules` break, in a town in which random trials hardly ever meet a corner."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Any
from unittest.mock import patch

from dubins_traffic.engine.controlled import Maker
from dubins_traffic.falsification import search
from dubins_traffic.falsification.case import Case
from dubins_traffic.falsification.search import GENERATION, SMALL, Search, falsify
from dubins_traffic.problem.configuration import Configuration
from tests.mutants import MUTANTS

TOWN: dict[str, Any] = {
    "version": 1, "problem_domain": "dubins_traffic", "network": {"grid": {"rows": 4, "columns": 4, "length": 6.0}},
    "car": {"w": 0.3, "body": {"disc": {"radius": 0.177}}, "bounds": {"speed": 0.7, "yaw_rate": 3.0}},
    "rate": 30, "sensing_radius": 5.0, "e-agents": [{"type": "lawful", "name": "car", "count": 2}],
    "number_goals_bounds": [2, 4], "rules": True,
}  # fmt: skip
"""Sixteen intersections and two other cars: in 15 s hardly anybody meets the ego unless somebody sees to it."""


LARGE = 512
"""Trials of a generation at random: what is drawn does not depend on it, and large ones take half the time."""


class _FoundError(Exception):
    """A search has found what it was to find."""


def first(name: str, strategy: str, seed: int, trials: int, world: dict[str, Any] = TOWN) -> int | None:
    """Return after how many trials a search found its first breach of a mutant, None if it found none in `trials`."""
    found = first_found(name, strategy, seed, trials, world)
    return None if found is None else found[0]


def first_found(
    name: str, strategy: str, seed: int, trials: int, world: dict[str, Any] = TOWN
) -> tuple[int, list[Case]] | None:
    """Return after how many trials a search found its first breach of a mutant, and the cases of that generation."""
    found: list[Search] = []
    least, most = (LARGE, LARGE) if strategy == "uniform" else (SMALL, GENERATION)

    def look(own: Search) -> None:
        if own.found_in:
            found.append(own)
            raise _FoundError

    with tempfile.TemporaryDirectory() as folder, patch.object(search, "SMALL", least):
        try:
            falsify(
                Configuration.from_document(world),
                MUTANTS[name].kind,
                Path(folder) / "found",
                trials=trials,
                most=most,
                seed=seed,
                strategy=strategy,
                progress=look,
            )
        except _FoundError:
            return 1 + min(found[0].found_in.values()), list(found[0].archive.cases.values())
    return None


def found_cases(world: Configuration, driver: str | Maker, count: int, seed: int, trials: int) -> list[Case]:
    """Return the first `count` cases that a search finds, or fewer if there are no more in `trials`."""
    found: list[Search] = []

    def look(own: Search) -> None:
        found[:] = [own]
        if len(own.found_in) >= count:
            raise _FoundError

    with tempfile.TemporaryDirectory() as folder, suppress(_FoundError):
        falsify(world, driver, Path(folder) / "found", trials=trials, seed=seed, progress=look)
    order = sorted(found[0].found_in, key=lambda name: (found[0].found_in[name], name))
    return [found[0].archive.cases[name] for name in order[:count]]


def first_broken(driver: str, rules: Collection[str], seed: int, trials: int) -> dict[str, tuple[int, float]]:
    """Return for each of some rules after how many trials, and seconds of a processor, a driver was found to break it.

    A search on `junction` is asked for these rules; it ends with the generation in which it has found them all.
    """
    found: dict[str, tuple[int, float]] = {}
    began = time.process_time()

    def look(own: Search) -> None:
        for name, number in own.found_in.items():
            found.setdefault(own.archive.cases[name].story.rule, (1 + number, time.process_time() - began))
        if found.keys() >= set(rules):
            raise _FoundError

    with tempfile.TemporaryDirectory() as folder, suppress(_FoundError):
        where = Path(folder) / "found"
        falsify("junction", driver, where, rules=sorted(rules), trials=trials, seed=seed, progress=look)
    return found
