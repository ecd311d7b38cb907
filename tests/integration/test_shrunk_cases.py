"""Shrunk cases: no false alarm, at most three cars in most, and nothing in them that could be taken away."""

from __future__ import annotations

from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.falsification.archive import files
from dubins_traffic.falsification.case import read_case
from tests.cases_again import driver_of, judged_afresh, still_broken
from tests.minute import a_minute

KEPT = Path(__file__).parents[1] / "cases"
CASES = sorted(path for path in KEPT.rglob("*.json") if KEPT / "contract" not in path.parents)
"""Those of `contract` are of both sides of the contract, and have no breach any more (`test_falsified_cases`)."""
MOST = 3
"""Cars, the ego counted."""
FRESH = 4
"""So many cases of a fresh search are shrunk here; `python -m experiments shrinking` takes 40, of all drivers."""


@pytest.mark.parametrize("path", CASES, ids=[f"{path.parent.name}-{path.stem}" for path in CASES])
def test_a_case_of_the_project_loses_its_breach_with_any_one_thing_less(path: Path) -> None:
    case = read_case(path)
    assert still_broken(case, driver_of(case)) == []


def test_so_do_cases_of_a_fresh_search_and_most_have_few_cars(tmp_path: Path) -> None:
    controller = "lanes"
    dt.falsify(a_minute("junction"), controller, tmp_path, trials=96, seed=5, duration=8.0)
    cases = [read_case(path) for path in files(tmp_path)][:FRESH]
    assert len(cases) == FRESH
    for case in cases:
        judged_afresh(case, controller)
    small = [dt.shrink(case) for case in cases]
    assert sum(len(case.instance.starts) <= MOST for case in small) >= 0.8 * len(small)
    for case in small:
        assert still_broken(case, controller) == []
