"""Control groups of version 2, under a kernel that has them: memory, processes and time are held by them alone."""

from __future__ import annotations

import json
import os
import sys

import pytest

from tests import guest

pytestmark = pytest.mark.tools

ATTACKS = os.environ.get("DUBINS_TRAFFIC_ATTACKS", "memory of many processes,processes").split(",")
"""``all`` runs every attack, for hours."""
PLACES = {
    "root": (0, "/sys/fs/cgroup"),
    "beside": (0, "/sys/fs/cgroup/slice"),
    "ordinary": (65533, "/sys/fs/cgroup/user"),
}
"""Who runs, and where groups are made then."""


@pytest.mark.parametrize("situation", sorted(PLACES) if ATTACKS == ["all"] else ["beside", "ordinary"])
def test_the_second_version_holds(situation: str) -> None:
    guest.require()
    user, place = PLACES[situation]
    status, said = guest.run([sys.executable, "-m", "tests.sandbox.second_version", *ATTACKS], situation, user=user)
    found = [json.loads(line) for line in said.splitlines() if line.startswith("{")]
    assert found, said
    assert found[0] == {"version": 2, "folders": [place]}, said
    assert found[1]["memory"] == "cgroup v2: memory"
    assert [own for own in found if not own.get("stopped", True)] == []
    assert ATTACKS == ["all"] or sum("attack" in own for own in found) == len(ATTACKS)
    assert status == 0, said
