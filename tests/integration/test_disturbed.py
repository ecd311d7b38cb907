"""Drivers whose commands come late and who see noisy poses; `experiments.disturbed` runs 3,200 trials of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from experiments.disturbed import CONTROLLERS, Drive, driven, provoked
from experiments.outside import SEED, TRIAL

from dubins_traffic.cars.state import Command, Observation, Pose, Propositions, Twist
from dubins_traffic.controllers.rules import Rules
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.envs.single import TrafficEnv
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.in_flight import InFlight
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.problem.public_problem import problem_from_document, problem_to_document
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.runs.sources import load_record
from dubins_traffic.verification.resimulate import trial_difference
from tests.contract_provoking import PROVOKING
from tests.contract_scenes import trial
from tests.ros import configuration


def problem(**disturbances: float) -> Problem:
    instance = draw(load_config("town"), 7, 0)
    return replace(instance, disturbances=Disturbances(**disturbances)).problem


def seen(tick: int, bits: int = 0) -> Observation:
    pose = Pose(*advance(0.0, 0.0, 1.0, 0.0, 0.3, 0.2, tick / 30.0))
    return Observation(tick, tick / 30.0, pose, Twist(0.3, 0.2), Propositions(-1, -1, -1, -1, bits), (), None)


@pytest.mark.parametrize("delay", [0, 1, 3])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_drivers_keep_the_rules_with_late_commands_and_noise(controller: str, delay: int) -> None:
    trials = [driven(Drive(controller, delay, number)) for number in (43, 51, 182, 188)]
    trials += [driven(Drive(controller, delay, number, "all")) for number in (3, 44)]
    assert [one.broken for one in trials] == [()] * 6
    assert sum(one.rounds for one in trials) >= 6


def test_a_delay_that_nobody_counts_in_breaks_rules() -> None:
    """The same trials with drivers who are not told of it."""

    class Untold(Rules):
        def start(self, problem: Problem) -> None:
            super().start(replace(problem, command_delay=0, pose_noise=(0.0, 0.0)))

    instance = draw(load_config("town"), 7, 0)
    late = replace(instance, disturbances=Disturbances(command_delay=3), duration=120.0)
    verdict = run_trial(late, Untold(), sketch=False).score.verdict
    assert verdict is not None
    assert any(one.car == "ego" for one in verdict.violations)


LOSSES = [("rules", 0), ("rules", 13), ("rules", 18)] + [
    ("lanes+shield", number) for number in (1, 9, 10, 11, 15, 16, 17)
]
"""Trials in which a lost command broke 3.stop as long as nobody reckoned with any."""


@pytest.mark.parametrize(("controller", "number"), LOSSES)
def test_one_lost_command_breaks_no_rule(controller: str, number: int, tmp_path: Path) -> None:
    instance = draw(load_config(configuration(tmp_path, **TRIAL)), SEED + number, 0)
    lossy = replace(instance, disturbances=Disturbances(command_delay=3, command_loss=0.1))
    verdict = run_trial(lossy, controller, sketch=False).score.verdict
    assert verdict is not None
    assert verdict.own_violations == ()
    assert verdict.rounds >= 1


def test_loss_adds_the_way_of_a_tick() -> None:
    noisy, lossy = problem(position_noise=0.005), problem(position_noise=0.005, command_loss=0.01)
    assert lossy.blur == noisy.blur == noisy.unsure
    assert lossy.unsure == pytest.approx(noisy.unsure + lossy.car.bounds.speed / lossy.rate)
    assert "command_loss" not in problem_to_document(noisy)["disturbances"]


def test_the_ego_is_seen_where_it_will_be() -> None:
    flight = InFlight(problem(command_delay=2))
    commands = [Command(0.5, 0.1), Command(0.4, -0.2), Command(0.0, 0.9)]
    ahead = []
    for tick, command in enumerate(commands):
        ahead.append(flight.ahead(seen(tick)))
        assert flight.sent(command) is command
    assert [tuple(one.pose) for one in ahead[:1]] == [(0.0, 0.0, 1.0, 0.0)]
    assert ahead[0].twist == (0.0, 0.0)
    pose = tuple(seen(2).pose)
    for command in commands[:2]:
        pose = advance(*pose, *command, 1.0 / 30.0)
    assert ahead[2].pose == pose
    assert ahead[2].twist == commands[1]
    assert ahead[2].others == ()


def test_without_a_delay_nothing_is_moved() -> None:
    flight, observation = InFlight(problem(position_noise=0.01)), seen(5, FLAG.FIRST)
    assert flight.ahead(observation) is observation


def test_a_place_counts_once_nobody_can_come_before_and_while_it_lasts() -> None:
    own = problem(command_delay=2)
    flight, bits = InFlight(own), int(FLAG.STOPPED | FLAG.FIRST | FLAG.CLEAR)
    first = [bool(flight.ahead(seen(tick, bits)).propositions.bits & FLAG.FIRST) for tick in range(100)]
    assert first.index(True) == 3  # group_time, 0.1 s
    assert [tick for tick in range(3, 100) if not first[tick]] == list(range(87, 100))  # forfeit_time, 3 s
    withheld = flight.ahead(seen(100, bits)).propositions.bits
    assert withheld & FLAG.AHEAD
    assert withheld & FLAG.STOPPED


def test_a_problem_says_delay_noise_and_loss_to_drivers_elsewhere() -> None:
    known: dict[str, Any] = {
        "command_delay": 2,
        "position_noise": 0.007,
        "heading_noise": 0.01,
        "command_loss": 0.5,
    }
    own = problem(**known)
    assert (own.command_delay, own.pose_noise, own.command_loss) == (2, (0.007, 0.01), 0.5)
    document = problem_to_document(own)
    assert document["disturbances"] == known
    assert problem_from_document(document) == own
    assert "disturbances" not in problem_to_document(problem())


def test_the_shield_tells_what_it_wraps_of_no_delay() -> None:
    told: list[Any] = []

    class Asks:
        def start(self, problem: Problem) -> None:
            told.append(problem.command_delay)

        def act(self, observation: Observation) -> tuple[float, float]:
            told.append(tuple(observation.pose))
            return 0.5, 0.0

    instance = draw(load_config("town"), 7, 0)
    late = replace(instance, disturbances=Disturbances(command_delay=3), duration=1.0)
    result = run_trial(late, Shield(Asks()), sketch=False)
    assert told[0] == 0
    assert result.score.verdict is not None
    poses = np.array(told[1:])
    assert poses.shape == (30, 4)
    assert np.hypot(*(poses[10, :2] - np.array(instance.starts[0][:2]))) > np.float64(0.0)


def all_late(delay: int) -> Instance:
    disturbed = Disturbances(command_delay=delay, position_noise=0.005, cars="all")
    return replace(draw(load_config("town"), 7, 1), disturbances=disturbed, duration=10.0)


def test_e_agents_stand_until_their_first_commands_take_effect(tmp_path: Path) -> None:
    run_trial(all_late(3), "rules", record=tmp_path / "late.mcap", sketch=False)
    record = load_record(tmp_path / "late.mcap")
    speeds = np.abs(record.frames.command_speed[1:, 1:])
    assert not speeds[:3].any()
    assert speeds[3:].any()
    assert trial_difference(record) is None


def test_a_fork_draws_other_noise() -> None:
    trial = Trial(all_late(1))
    for _ in range(30):
        trial.advance((0.0, 0.0))
    same, other = trial.fork(), trial.fork(seed=99)
    for one in (trial, same, other):
        for _ in range(90):
            one.advance((0.0, 0.0))
    mine, its, others = (np.array([own.pose for own in one.observation.others]) for one in (trial, same, other))
    assert np.array_equal(mine, its)
    assert not np.array_equal(mine, others)


@pytest.mark.parametrize(("number", "delay"), [(5, 3), (0, 2), (2, 1)])
def test_e_agents_are_refused_what_they_cannot_foresee(number: int, delay: int) -> None:
    """Long rectangles at 30 Hz, discs at 10 Hz, short rectangles at 10 Hz."""
    late = Disturbances(command_delay=delay, position_noise=0.005, cars="all")
    with pytest.raises(InputError, match="others may get too far") as refused:
        trial("ego_holds", number, 1.0, late)
    assert refused.value.field == "disturbances"
    assert not trial("ego_holds", number, 30.0, late.model_copy(update={"command_delay": delay - 1})).others


@pytest.mark.parametrize("place", range(0, len(PROVOKING), 3))
def test_late_cars_are_provoked_by_no_clean_ego(place: int) -> None:
    name = list(PROVOKING)[place]
    came = [provoked((name, number, 2)) for number in (1, 3, 13)]
    assert [one.others for one in came if one is not None and not one.own] in ([()], [()] * 2, [()] * 3)


def test_no_environment_has_late_e_agents() -> None:
    document = {**load_config("town").document, "disturbances": {"command_delay": 1, "cars": "all"}}
    with pytest.raises(InputError, match="environment"):
        TrafficEnv(load_config(document))
