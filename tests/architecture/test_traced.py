"""What `run_batch`, `run_trial` and the command `run` enter: few rooms call a higher one, none has two reasons."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from tests.architecture.buildings import CORE, town
from tests.architecture.house import PACKAGE, ROOT
from tests.architecture.traced import CALLS, traced

MOST_RETURNS = 3
"""So many pairs of rooms may there be of which the lower one calls the higher one."""
REASONS = {
    "agents": ("drive the e-agents", "fleet free kernel late lawful tables"),
    "campaign": ("says what many trials say together", "notice"),
    "cars": (
        "have bodies that move, touch and see",
        "body clip_and_move motion near propositions read_only sensing state tables touching",
    ),
    "controllers": ("drive the ego", "blame lanes registry"),
    "engine": ("steps many trials together", "egos"),
    "errors": ("names what is wrong", "shown"),
    "files": ("reads the configuration", "decoded exists is_file is_stream packed read_bytes"),
    "kernels": (
        "compute, and find their machine code",
        "angles arrays boxes folders kinds levels library machine philox random records sources tables trig",
    ),
    "logic": ("reads formulas", "formula parse rewrite"),
    "moved": ("looks for earlier names", "Moved"),
    "observations": ("tell drivers what they see", "senses"),
    "outside": ("keeps what code of users may change", "put_back"),
    "policies": ("choose commands", "in_flight lanes rules waypoint"),
    "problem": ("draws the instance", "configuration draw files instance kinds parts settings starts"),
    "record": ("says how a trial ended and how long it took", "header sink wall"),
    "roads": ("say where points lie on them", "chains cover formats lookup network packing table"),
    "routing": ("finds rounds through the goals", "lane_graph rounds tours"),
    "rules": (
        "label frames and find breaches",
        "breach_log exits explained frame judged label_cache labeller location obstacles parameters referee "
        "referee_kernel shape tables visits",
    ),
    "runs": ("carries a plan out", "jobs plan processes"),
    "scoring": (
        "counts and says what it means",
        "counts margins own_metrics registry score tally tracked verdict",
    ),
    "sessions": ("names the transports of the command's help", "registry"),
    "shield": ("has no car to guard", "tables"),
    "simulators": ("move the cars", "embedded registry"),
    "trial": ("steps a trial", "disturbance run seat trial"),
    "viewer": ("sketches paths", "paths"),
}
"""For what each room is entered in such a call, the one reason, and by which of its modules."""
SECONDS = 1.0


@cache
def done(call: str) -> dict[str, Any]:
    """Return what a call of a short trial does, in a process of its own."""
    document = json.loads((PACKAGE / "problem" / "configurations" / "demo.json").read_text(encoding="utf-8"))
    with TemporaryDirectory() as folder:
        (Path(folder) / "short.json").write_text(json.dumps({**document, "duration": SECONDS}))
        command = [sys.executable, "-m", "tests.architecture.traced", call, folder]
        told = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True, timeout=1200)
    return json.loads(told.stdout)


@pytest.mark.long
@pytest.mark.parametrize("call", sorted(CALLS))
def test_few_rooms_call_a_higher_one(call: str) -> None:
    returns = done(call)["returns"]
    assert len(returns) <= MOST_RETURNS, returns


@pytest.mark.long
@pytest.mark.parametrize("call", sorted(CALLS))
def test_no_room_is_entered_for_two_reasons(call: str) -> None:
    modules = done(call)["modules"]
    assert len(modules) > 15
    assert modules.keys() <= REASONS.keys()
    others = {room: {*names} - {*REASONS[room][1].split()} for room, names in modules.items()}
    assert {room: names for room, names in others.items() if names} == {}


@pytest.mark.long
def test_a_trial_and_a_batch_stay_in_core() -> None:
    for call in ("run_batch", "run_trial"):
        assert {town().building[room] for room in done(call)["modules"]} == {CORE}


def test_a_call_upward_is_seen() -> None:
    from dubins_traffic.outside import plainly
    from dubins_traffic.routing.rounds import find_all

    class ToldError(Exception):
        def __str__(self) -> str:
            find_all([])
            return "told"

    trace = traced(lambda: plainly(ToldError()))
    assert trace.returns() == ["outside.plainly -> routing.rounds.find_all"]
    assert set(trace.modules()) >= {"errors", "routing"}
