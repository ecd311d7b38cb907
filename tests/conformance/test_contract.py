"""The suite that every change of the norm must pass: agents that try to block the ego, egos that try to provoke.

The e-agents of `tests.contract_scenes.BLOCKING` stand in the way of the ego `rules`. Until one of them has broken a
rule, the ego may not be without a visit for longer than a bound: all of them together may take the longest journey each
(E5, with what excuses for a while) and the longest stay in a goal (E6), and so may whoever waits for them. The egos of
`PROVOKING` are among `lawful` cars, and as long as they have broken nothing, these break nothing.

``DUBINS_TRAFFIC_CONTRACT=full`` runs more than 2,000 trials of 300 s whose obstacles are admitted.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import pytest
from experiments.conformance import SECONDS as LONG
from experiments.conformance import TRIALS

from tests.contract_blocking import BLOCKING
from tests.contract_provoking import PROVOKING
from tests.contract_scenes import SCENES, Came, trial

FULL = os.environ.get("DUBINS_TRAFFIC_CONTRACT") == "full"
NUMBERS = tuple(range(TRIALS // len(SCENES) + 1)) if FULL else tuple(range(4))
FELL = {
    "disc_edge_out": (7, 8),
    "before_obstacle": (4, 9, 14, 34, 44),
    "head_on": (7, 12, 13, 24, 36),
    "ring": (5,),
    "spinner": (20, 38, 44),
    "ego_beyond_exit": (14, 18),
    "ego_closes": (29, 44),
    "ego_tilted": (10, 14, 16, 20, 29, 34, 38, 40),
    "ego_in_bend": (29,),
    "ego_whims": (10, 14, 16, 22, 27, 28, 34, 40, 46, 50, 52, 58),
}
"""Trials beyond the first ones in which the bar once did not hold."""
SECONDS = LONG if FULL else None


def _came(name: str) -> list[Came]:
    """Return what came of the trials of a scene whose obstacles are admitted."""
    numbers = sorted({*NUMBERS, *FELL.get(name, ())})
    if FULL:
        with ProcessPoolExecutor() as pool:
            came = list(pool.map(partial(trial, name, seconds=SECONDS), numbers))
    else:
        came = [trial(name, number) for number in numbers]
    admitted = [one for one in came if one.admitted]
    assert admitted
    return admitted


@pytest.mark.parametrize("name", list(BLOCKING))
def test_who_blocks_the_ego_breaks_a_rule(name: str) -> None:
    came = _came(name)
    assert [one for one in came if one.own] == []
    assert [one for one in came if one.waited > one.bound] == []


@pytest.mark.parametrize("name", list(PROVOKING))
def test_no_clean_ego_brings_a_lawful_car_to_a_breach(name: str) -> None:
    came = _came(name)
    assert any(not one.own for one in came)
    assert [one for one in came if one.others and not one.own] == []
