"""What a search sees of `lanes` that is driven without observations is what it sees of the controller."""

from __future__ import annotations

import pytest

from dubins_traffic.controllers.registry import load
from dubins_traffic.falsification.sampling import Source, prepared
from dubins_traffic.falsification.trying import TrialRunner, in_order
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.instance import Instance
from dubins_traffic.shield.tables import Overtakes
from tests.minute import a_minute
from tests.mutant_searches import TOWN


def trials(world: str, seconds: float, count: int) -> list[Instance]:
    """Return trials of a search; in the town obstacles block roads, and egos see no farther than they must."""
    document = {
        **TOWN, "sensing_radius": 3.4,
        "obstacles": [{"disc": {"x": 3.0 + 6.0 * k, "y": 5.85, "radius": 0.1}} for k in range(3)],
        "e-agents": [{"type": "lawful", "name": "car", "count": 6}],
    }  # fmt: skip
    own = a_minute(world) if world != "town" else Configuration.from_document(document)
    source = Source(prepared(own, seconds, {}), 3)
    return source.build([source.fresh(number) for number in range(count)])


@pytest.mark.parametrize(
    ("world", "overtakes", "seconds", "count"),
    [("junction", "sure", 4.0, 6), ("town", "law", 12.0, 3), ("town", None, 20.0, 6)],
)
def test_trials_without_observations_equal_those_with(
    world: str, overtakes: Overtakes | None, seconds: float, count: int
) -> None:
    own = trials(world, seconds, count)
    name = "lanes" if overtakes is None else f"lanes+shield:{overtakes}"
    fast = TrialRunner(name).attempt(own)
    slow = TrialRunner(lambda: load(name)).attempt(own)
    assert in_order(fast) == in_order(slow)
