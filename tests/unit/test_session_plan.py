"""What a session says before its first trial: that something is compiled, only where that takes more than a moment."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import pytest

from dubins_traffic.sessions import plan
from dubins_traffic.sessions.plan import session_plan


@pytest.mark.parametrize("lasts", [False, True])
def test_compiling_is_told_of_only_where_it_takes_more_than_a_moment(
    lasts: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    said: list[str] = []

    def rehearse(*_args: Any, **_options: Any) -> None:
        while lasts and (not said or time.monotonic() - began <= plan.SOON):
            time.sleep(0.01)

    monkeypatch.setattr(plan, "SOON", 0.2 if lasts else 3600.0)
    monkeypatch.setattr(plan, "rehearse", rehearse)
    session = replace(session_plan("demo"), say=said.append)
    began = time.monotonic()
    session.rehearse()
    assert [line.split()[0] for line in said] == (["compiling", "compiled,"] if lasts else [])


def test_a_moment_is_a_second() -> None:
    assert plan.SOON >= 1.0
