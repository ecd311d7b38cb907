"""Drivers that the record belies: e-agents driven otherwise, and controllers that write the simulator's state."""

import gc
from dataclasses import replace
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.cars.state import State
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.sessions.remote import hand_over
from dubins_traffic.verification.verify import verify
from dubins_traffic.verification.worlds import Replayed
from tests.tampering import heading, rebuilt
from tests.unit.test_verify import CARS, INSTANCE, TICKS, outcome


def test_e_agents_that_were_driven_otherwise_are_refused(tmp_path: Path) -> None:
    """Another program drives the e-agents, consistently, and the record says that they drove themselves."""
    run_trial(INSTANCE, "simple", record=tmp_path / "a.mcap")
    frames = dt.load_record(tmp_path / "a.mcap").frames
    slower = replace(frames, command_speed=0.9 * frames.command_speed)
    writer = RecordWriter(tmp_path / "b.mcap", controller="simple")
    made = Trial.__mro__[1](
        hand_over(INSTANCE, ["agent0", "agent1"]),
        simulator=dt.Trial(INSTANCE)._simulator,
        agents=[Replayed(slower, (1, 2))],
        sinks=[writer],
    )
    for k in range(TICKS):
        made.advance((float(frames.command_speed[k + 1, 0]), 0.0))
    assert verify(tmp_path / "b.mcap").verified, "of remote e-agents the commands are taken as recorded"
    ours = heading(lambda own: own["instance"].update({"e-agents": instance_to_document(INSTANCE)["e-agents"]}))
    found = outcome(rebuilt((tmp_path / "b.mcap").read_bytes(), ours), tmp_path / "c.mcap")
    assert "command_speed of agent" in str(found)


class Cheat:
    """Finds the simulator's state and moves the ego, or a car ahead of it, in mid-trial."""

    def __init__(self, car: int) -> None:
        self.car = car

    def start(self, problem: dt.Problem) -> None:
        """Nothing to prepare."""

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        if observation.tick == 30:
            for found in gc.get_objects():
                if isinstance(found, State) and found.x.shape == (1, CARS):
                    found.y[0, self.car] += 0.5
        return 0.3, 0.0


@pytest.mark.parametrize("car", [0, 1])
def test_a_controller_that_writes_the_state_is_refused(car: int, tmp_path: Path) -> None:
    run_trial(INSTANCE, Cheat(car), record=tmp_path / "a.mcap")
    found = verify(tmp_path / "a.mcap")
    assert found.difference is not None
    assert found.difference.tick in (30, 31)
    assert not outcome((tmp_path / "a.mcap").read_bytes(), tmp_path / "b.mcap").verified
