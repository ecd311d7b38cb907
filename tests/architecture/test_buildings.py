"""The buildings of the house: core is small enough to be read, and the contract finds what it should."""

from __future__ import annotations

import pytest

from tests.architecture.buildings import BUILDINGS, CORE, faults, town, town_of
from tests.architecture.house import modules

MOST_OF_CORE = 46_000
"""Lines of core, the package's own `__init__` among them; a number that may only fall."""
SMALL = {
    "roof": ["cli"],
    "arena": ["service", "sandbox"],
    "research": ["suites | envs", "campaign"],
    "bridges": ["sessions", "transports"],
    "core": ["trial", "roads | cars"],
    "arrows": ["arena -> research", "sandbox -> transports"],
}


def test_core_is_small_enough_to_be_read() -> None:
    lines = {module.name: module.text.count("\n") for module in modules()}
    own = [name for name in lines if town().building.get(name.partition(".")[0], CORE) == CORE]
    assert "" in own
    assert sum(lines[name] for name in own) <= MOST_OF_CORE


def test_each_building_has_rooms() -> None:
    assert all(town().rooms(name) for name in BUILDINGS)


@pytest.mark.parametrize(
    ("module", "other", "may"),
    [
        ("cli.run", "service.queue", True),
        ("service.queue", "sandbox.box", True),
        ("sandbox.box", "service.queue", False),
        ("suites.suite", "campaign.table", True),
        ("suites.suite", "envs.fleet", False),
        ("suites.suite", "roads.network", True),
        ("service.queue", "campaign.table", True),
        ("campaign.table", "sandbox.box", False),
        ("sandbox.box", "transports.lines", True),
        ("service.queue", "transports.lines", False),
        ("trial.trial", "cars.state", True),
        ("cars.state", "trial.trial", False),
        ("cars.state", "roads.network", False),
        ("trial.trial", "campaign.table", False),
        ("trial.trial", "cli.run", False),
    ],
)
def test_a_room_may_know_what_is_below_it_and_where_arrows_lead(module: str, other: str, may: bool) -> None:
    found = town_of(SMALL)
    assert (list(faults(found, {*found.building}, [(module, other)])) == []) == may


def test_rooms_in_no_building_and_missing_rooms_are_found() -> None:
    found = town_of(SMALL)
    there = {*found.building} - {"roads"} | {"attic"}
    assert list(faults(found, there, [])) == ["attic is in no building", "there is no room roads"]


def test_a_contract_that_says_no_town_is_refused() -> None:
    with pytest.raises(ValueError, match="cars is listed twice"):
        town_of({**SMALL, "bridges": ["cars"]})
    for arrow in ("arena", "arena -> nowhere"):
        with pytest.raises(ValueError, match="an arrow leads"):
            town_of({**SMALL, "arrows": [arrow]})
