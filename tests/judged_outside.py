"""Trials in a world that is not ours (`tests/cars_outside.py`): what is driven, and what has to come of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.record.sink import End
from tests.ros import ROOT

COURSE: dict[str, Any] = {
    "duration": 3.0,
    "number_trials": 1,
    "e-agents": [{"type": "scripted", "name": "agent0", "parameters": {"commands": [[9, 0.2, 0.0]]}}],
}
"""The trial, beside the defaults of `tests.ros.configuration`."""
SMOOTH = f"{ROOT}/tests/smooth.py:Smooth"
"""Who drives the ego."""
FAULTS = [("freeze", "frozen"), ("jump", "jumped"), ("stop", "no pose")]
"""How a world fails, and a word of the reason for which the trial ends."""


def verified(records: Path, world: str) -> dt.Record:
    """Return the record of the only trial, which has been driven in that world and passes what is checked of it."""
    found = dt.verify(records / "trial-0000.mcap")
    assert found.verified, found
    assert found.world == world
    return dt.load_record(records / "trial-0000.mcap")


def require_driven(record: dt.Record) -> None:
    """See that both cars have driven for the whole duration."""
    assert record.ending is not None
    assert record.ending.end is End.DURATION
    frames = record.frames
    assert len(frames) == 91
    assert (frames.x[0, 0], frames.y[0, 0]) == (0.0, -0.3)
    assert frames.x[-1, 0] > 0.3
    assert frames.x[-1, 1] - frames.x[0, 1] == pytest.approx(0.6, abs=0.1)


def require_lost(record: dt.Record, word: str) -> None:
    """See that the trial ended since its world was lost, for that reason."""
    assert record.ending is not None
    assert record.ending.end is End.WORLD_LOST
    assert word in record.ending.detail


def require_measured(record: dt.Record, said: str) -> None:
    """See that 50 ms of delay and 5 mm of noise, with poses at 27 to 33 Hz, were measured, declared and said."""
    declared = record.instance.disturbances
    assert declared.cars == "all"
    # 50 ms, poses up to 37 ms old, and a tick; more on a busy machine.
    assert 3 <= declared.command_delay <= 8
    assert 0.001 < declared.position_noise < 0.0025
    assert "commands take effect late" in said
    assert record.instance.problem.command_delay == declared.command_delay
