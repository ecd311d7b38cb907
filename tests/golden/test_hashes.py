"""Every golden case gives what it gave."""

from __future__ import annotations

import pytest

from tests.golden.cases import cases
from tests.golden.hashes import differences, golden, hashes

CASES = cases()
GROUPS = sorted({name.rpartition("/")[0] or name for name in CASES})


def test_there_are_enough_cases() -> None:
    assert len(CASES) >= 240
    assert golden().keys() == CASES.keys()


@pytest.mark.parametrize("group", GROUPS)
def test_hashes_are_the_golden_ones(group: str) -> None:
    expected = golden()
    names = [name for name in CASES if (name.rpartition("/")[0] or name) == group]
    assert [line for name in names for line in differences(name, hashes(CASES[name]), expected[name])] == []
