"""A batch gives the scores and verdicts of its trials run one by one, bit for bit."""

import gc
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
import pytest

from dubins_traffic.cars.state import Command, Observation, Pose
from dubins_traffic.engine.batch import failed, outcomes, run_batch
from dubins_traffic.engine.controlled import BatchView
from dubins_traffic.engine.egos import Egos, ask
from dubins_traffic.engine.group import Group
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Problem
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score, score
from tests.rules_scripts import on_lane

SEED = 5
AGENTS = [
    {"type": "lawful", "name": "agent", "count": 2},
    {"type": "lawful", "name": "rogue", "parameters": {"rolls": 0.4, "left": 0.3, "tailgates": 0.5}},
    {"type": "nemesis", "name": "nemesis"},
    {"type": "wander", "name": "agent", "count": 2},
    {"type": "loop", "name": "loop"},
    {"type": "follow", "name": "agentf"},
    {"type": "parked", "name": "parked", "parameters": {"vacates_after": 3.0}},
]
OWN_NETWORKS = {"random": {"intersections": 8, "segments": 10}}
GRID = {"grid": {"rows": 3, "columns": 3, "length": 4.0}}


HURRY = {
    "linger_time": 0.5, "rest_time": 0.2, "exit_time": 4.0, "goal_time": 1.0, "shared_time": 0.3, "forfeit_time": 0.5,
    "enter_time": 0.4, "stand_time": 0.2, "stop_time": 0.2, "journey_start_time": 0.2,
}  # fmt: skip
"""Rules that are soon broken: E3 to E6 too."""


def configuration(**more: Any) -> Configuration:
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": GRID,
        "rules": {},
        "e-agents": AGENTS,
        "number_trials": 5,
        "number_goals_bounds": [1, 3],
        "duration_bounds": [5, 9],
        **more,
    }
    return load_config(document)


def plain(found: Score) -> Mapping[str, Any]:
    """Return what of a score is no matter of clocks and places."""
    return {
        name: value
        for name, value in found.to_json().items()
        if name not in ("time_to_begin_s", "record", "controller", "ran")
    }


@pytest.mark.parametrize("controller", ["rules", "simple", "lanes", "lanes+shield"])
@pytest.mark.parametrize(
    "more",
    [
        {},
        {"rules": False, "end_on_collision": True},
        {"disturbances": {"command_delay": 2, "command_loss": 0.2, "position_noise": 0.01}},
        {"obstacles": [{"disc": {"x": 4.0, "y": 0.3, "radius": 0.2}}]},
        {"rules": HURRY, "network": OWN_NETWORKS},
    ],
    ids=["judged", "to-collision", "disturbed", "obstacle", "hurried"],
)
def test_a_batch_equals_its_trials_one_by_one(controller, more) -> None:
    config = configuration(**more)
    found = run_batch(config, controller, seed=SEED, batch=3).outcomes
    assert [own.instance.trial for own in found] == list(range(5))
    for own in found:
        single = run_trial(draw(config, SEED, own.instance.trial), controller)
        assert own.ending == single.ending
        assert plain(own.score) == plain(single.score)


def test_networks_of_their_own_and_a_batch_of_any_size_and_threads() -> None:
    agents = [{"type": "lawful", "name": "agent", "count": 3}]
    config = configuration(
        network=OWN_NETWORKS, **{"e-agents": agents}, rules={"approach_distance": 0.6, "queue_distance": 0.6}
    )
    sheets = [
        run_batch(config, trials=6, seed=SEED, batch=batch, threads=threads).sheet
        for batch, threads in ((1, 1), (4, 2), (64, 1))
    ]
    assert sheets[0] == sheets[1] == sheets[2]
    single = run_trial(draw(config, SEED, 4), "rules")
    assert plain(sheets[0].trials[4]) == plain(single.score)
    assert single.score.icra2016 is None, "the network is no grid"


def test_a_score_that_is_not_defined_is_none_in_a_batch_too() -> None:
    for agents, defined in (([], True), ([{"type": "loop", "name": "bus"}], False), (AGENTS[:2], True)):
        config = configuration(**{"e-agents": agents}, duration_bounds=[2, 2])
        (own,) = run_batch(config, trials=1, seed=SEED).outcomes
        single = run_trial(draw(config, SEED, 0), "rules").score
        assert plain(own.score) == plain(single)
        assert (single.icra2016 is not None) == defined


def test_a_world_with_so_many_cars_that_they_are_looked_for_in_cells() -> None:
    config = configuration(
        network={"grid": {"rows": 4, "columns": 4, "length": 4.0}},
        **{"e-agents": [{"type": "lawful", "name": "agent", "count": 30, "parameters": {"rolls": 0.3}}]},
        duration_bounds=[12, 12],
    )
    (own,) = run_batch(config, trials=1, seed=SEED).outcomes
    single = run_trial(draw(config, SEED, 0), "rules")
    assert own.score.verdict is not None
    assert own.score.verdict.violations
    assert plain(own.score) == plain(single.score)


OBSTACLES = [{"disc": {"x": 6.0, "y": -0.3, "radius": 0.2}}, {"disc": {"x": 2.0, "y": 3.7, "radius": 0.2}}]
PARKS = {"parks": 0.5, "blocks": 0.3, "left": 0.2}


@pytest.mark.parametrize(
    "more",
    [
        {
            "e-agents": [{"type": "lawful", "name": "agent", "count": 3, "parameters": PARKS}],
            "network": OWN_NETWORKS,
        },
        {"e-agents": [], "obstacles": OBSTACLES},
        {"e-agents": [{"type": "lawful", "name": "agent", "count": 40}]},
    ],
    ids=["stands for a while", "nobody but an obstacle", "more cars than a block holds"],
)
def test_cars_that_just_drive_on_stop_where_they_do_by_themselves(more) -> None:
    config = configuration(
        duration_bounds=[60, 60],
        **{"network": {"grid": {"rows": 4, "columns": 5, "length": 4.0}}, **more},
    )
    for own in run_batch(config, trials=6, seed=SEED).outcomes:
        assert plain(own.score) == plain(run_trial(draw(config, SEED, own.instance.trial), "rules").score)


class Wheel:
    """Drives in a circle; by itself and for whole batches."""

    views: ClassVar[list[BatchView]] = []

    def start(self, problem: Problem) -> None:
        self._speed = 0.1 * len(problem.goals)

    def act(self, observation: Observation) -> Command:
        return Command(self._speed + 0.01 * len(observation.others), 0.3)

    def start_batch(self, trials, problems) -> None:
        self._speeds = {**getattr(self, "_speeds", {})}
        self._speeds |= {t: 0.1 * len(problem.goals) for t, problem in zip(trials, problems, strict=True)}

    def act_batch(self, view: BatchView) -> np.ndarray:
        self.views.append(view)
        speed = np.array([self._speeds[t] for t in view.trial.tolist()])
        return np.stack([speed + 0.01 * (view.seen.sum(axis=1) - 1), np.full(len(speed), 0.3)], axis=1)


def test_a_vectorised_controller_gets_all_trials_at_once_and_those_that_end_are_replaced() -> None:
    Wheel.views = []
    config = configuration()
    found = run_batch(config, Wheel, trials=5, seed=SEED, batch=3).outcomes
    for own in found:
        assert plain(own.score) == plain(run_trial(draw(config, SEED, own.instance.trial), Wheel()).score)
    sizes = [len(view.trial) for view in Wheel.views]
    assert max(sizes) == 3
    ends = {own.instance.trial: own.instance.ticks for own in found}
    first = min(ends[trial] for trial in range(3))
    assert sizes[: first + 1] == [3] * (first + 1)
    assert set(Wheel.views[first].trial.tolist()) - {0, 1, 2}
    assert sum(sizes) == sum(ends.values())
    view = Wheel.views[0]
    assert np.isnan(view.state.x[~view.seen]).all()
    assert (view.labels.lane[~view.seen] == -1).all()
    assert np.isfinite(view.state.x[view.seen]).all()


class Swing:
    """Swings over the edge of a disc for some time, drives to the next one and back, and swings again."""

    def start(self, problem: Problem) -> None: ...

    def act(self, observation: Observation) -> Command:
        part = observation.tick % 300
        if part < 120:
            return Command(-0.7 if part // 20 % 2 == 0 else 0.7, 0.0)
        return Command(0.7, 0.0) if part < 195 else Command(-0.7, 0.0) if part < 270 else Command(0.0, 0.0)

    def close(self) -> None: ...


def test_visits_are_counted_alike_of_who_swings_over_the_edge_of_a_disc() -> None:
    """It comes into the disc six times, and after three of them it has been in another one."""
    config = configuration(
        **{
            "duration_bounds": [20, 20],
            "goals": [[0, 0]],
            "ego": {"start": [1.2, -0.3, 0.0]},
            "e-agents": [],
        },
        network={"grid": {"rows": 2, "columns": 2, "length": 3.0}},
    )
    (found,) = run_batch(config, Swing, trials=1, seed=SEED).outcomes
    single = run_trial(draw(config, SEED, 0), Swing())
    assert plain(found.score) == plain(single.score)
    assert single.score.goals[0].visits == single.score.rounds == 2


class Broken(Wheel):
    def act_batch(self, view: BatchView) -> np.ndarray:
        commands = super().act_batch(view)
        commands[view.trial == 1] = np.nan
        return commands if view.tick.max() < 20 else commands[:, :1]


def test_a_fault_ends_the_trials_that_it_is_about() -> None:
    found = run_batch(configuration(), Broken, trials=3, seed=SEED).outcomes
    assert {own.ending.end for own in found} == {End.CONTROLLER_FAULT}
    assert [own.ending.ticks for own in found] == [20, 0, 20]
    assert "finite" in found[1].ending.detail
    assert "(3, 2)" in found[0].ending.detail or "(2, 2)" in found[0].ending.detail


class Quitter:
    def start(self, problem: Problem) -> None:
        self._ticks = 3 if len(problem.goals) > 1 else 6

    def act(self, observation: Observation) -> Command | None:
        if observation.tick == 5:
            raise ValueError("enough")
        return None if observation.tick == self._ticks else Command(0.2, 0.0)

    def close(self) -> None:
        raise RuntimeError("stuck")


def test_plain_controllers_end_as_they_do_alone() -> None:
    config = configuration()
    for own in ask([draw(config, SEED, k) for k in range(5)], Egos(Quitter), 2):
        assert own.ending == run_trial(draw(config, SEED, own.instance.trial), Quitter()).ending


def test_trials_that_all_end_at_once_leave_their_places_to_the_rest() -> None:
    config = configuration(duration_bounds=[1, 1])
    found = [own.instance.trial for own in ask([draw(config, SEED, k) for k in range(5)], Egos(Stands), 2)]
    assert found == [0, 1, 2, 3, 4]


class Gives:
    """Stands, and gives up after some ticks; a start in the only goal's disc has then made a round."""

    def start(self, _problem: Problem) -> None:
        self._ticks = 7

    def act(self, observation: Observation) -> Command | None:
        return Command(0.0, 0.0) if observation.tick < self._ticks else None


class Stands(Gives):
    def start(self, _problem: Problem) -> None:
        self._ticks = 10**6


@pytest.mark.parametrize("driver", [Gives, Stands])
def test_only_who_stays_to_the_end_is_clean_and_counts(driver: type[Gives], tmp_path) -> None:
    config = configuration(**{"e-agents": []}, number_goals_bounds=[1, 1], duration_bounds=[2, 2])
    drawn = draw(config, SEED, 0)
    network = drawn.problem.network
    goal = network.intersections[0]
    x, y = network.points[0]
    instance = replace(
        drawn, problem=replace(drawn.problem, goals=(goal,)), starts=(Pose(float(x), float(y), 1.0, 0.0),)
    )
    (own,) = ask([instance], Egos(driver), 1)
    single = run_trial(instance, driver(), record=tmp_path / "trial.mcap").score
    kept = score(read(tmp_path / "trial.mcap"))
    assert plain(own.score) == plain(single) == plain(kept)
    assert single.verdict is not None
    whole = driver is Stands
    assert (single.rounds, single.counted_rounds) == (1, int(whole))
    assert (single.verdict.verdict, single.verdict.clean) == ("unfinished", whole)
    assert single.verdict.longest_gap_s == 2.0, "gaps run to the planned end"


class Strays(Gives):
    """Stands for two seconds, then drives over the centre line."""

    def act(self, observation: Observation) -> Command:
        return Command(0.0, 0.0) if observation.tick < 60 else Command(0.3, 1.0)


@pytest.mark.parametrize(("lane", "near"), [(0, True), (20, False)])
def test_a_collision_among_others_is_near_or_not(lane: int, near: bool, tmp_path) -> None:
    drawn = draw(configuration(duration_bounds=[4, 4]), SEED, 0)
    network = drawn.problem.network
    agents = tuple(
        EAgent("scripted", f"agent{k}", "scripted", {"commands": [[4.0, speed, 0.0]]})
        for k, speed in enumerate((0.5, 0.0))
    )
    problem = replace(drawn.problem, e_agents=("agent0", "agent1"), rules={"assume_e1": 0})
    places = [on_lane(network, lane, 2.0, -0.3), *(on_lane(network, 3, s, -0.3) for s in (1.4, 2.0))]
    instance = replace(drawn, problem=problem, e_agents=agents, starts=tuple(Pose(*p) for p in places))
    (own,) = ask([instance], Egos(Strays), 1)
    single = run_trial(instance, Strays(), record=tmp_path / "trial.mcap").score
    assert plain(own.score) == plain(single) == plain(score(read(tmp_path / "trial.mcap")))
    found = single.verdict
    assert found is not None
    assert found.excuse is not None
    assert (found.excuse.assumption, found.excuse.violation.car) == ("E2", "agent0")
    assert {breach.rule for breach in found.violations if breach.car != "ego"} == {"E2"}
    assert found.near is near


def test_records_are_those_of_single_trials(tmp_path) -> None:
    config = configuration()
    found = run_batch(config, seed=SEED, keep="sample:2", records=tmp_path / "some")
    assert sorted(path.name for path in (tmp_path / "some").glob("*.mcap")) == [
        "trial-0000.mcap",
        "trial-0002.mcap",
    ]
    run_trial(draw(config, SEED, 2), "rules", record=tmp_path / "alone.mcap")
    kept = tmp_path / "some" / "trial-0002.mcap"
    assert kept.read_bytes() == (tmp_path / "alone.mcap").read_bytes()
    assert found.outcomes[2].score.record == str(kept)
    assert plain(score(read(str(kept)))) == plain(found.outcomes[2].score)
    found = run_batch(config, "simple", seed=SEED, keep="failures", records=tmp_path / "failures")
    wanted = [f"trial-{own.instance.trial:04d}.mcap" for own in found.outcomes if failed(own)]
    assert len(wanted) > 0
    assert sorted(path.name for path in (tmp_path / "failures").glob("*.mcap")) == wanted


def test_what_is_wrong_is_refused() -> None:
    config = configuration()
    for wrong in ({"batch": 0}, {"trials": 0}, {"threads": 0}, {"keep": "some"}, {"keep": "all"}):
        with pytest.raises(InputError):
            run_batch(config, **wrong)
    with pytest.raises(InputError, match="noise"):
        list(
            outcomes(
                [draw(configuration(disturbances={"position_noise": 0.1}), 0, 0)],
                Wheel,
            )
        )


def test_room_for_pairs_contacts_and_breaches_is_found_when_it_is_needed(monkeypatch) -> None:
    from dubins_traffic.engine import group

    config = configuration()
    instances = [draw(config, SEED, k) for k in range(3)]

    def results() -> list[Mapping[str, Any]]:
        own = Group(instances, keeps_rules=True)
        own.finish()
        return [plain(outcome.score) for outcome in own.outcomes(range(3), "rules")]

    roomy = results()
    monkeypatch.setattr(group, "PAIRS", 1)
    monkeypatch.setattr(group, "FRAMES", 1)
    monkeypatch.setattr(group, "WORK", 100)
    assert results() == roomy


def test_a_frame_in_which_every_goal_is_taken_finds_room_for_its_breaches(monkeypatch) -> None:
    """With many goals and no e-agents a frame can begin more breaches than cars alone would."""
    from dubins_traffic.engine import group

    config = configuration(
        **{"e-agents": [], "network": {"grid": {"rows": 17, "columns": 17, "length": 4.0}}},
        number_goals_bounds=[289, 289],
        duration_bounds=[1, 1],
    )
    calls = []
    run = group.run_trials

    def counted(*given: Any) -> None:
        calls.append(1)
        assert len(calls) < 100, "no room is ever found"
        run(*given)

    monkeypatch.setattr(group, "run_trials", counted)
    (own,) = ask([draw(config, SEED, 0)], Egos(Stands), 1)
    assert own.ending.end is End.DURATION
    assert len(own.score.goals) == 289


@pytest.mark.parametrize("controller", ["rules", "lanes"])
def test_nothing_is_left_of_the_trials_that_a_batch_has_run(controller) -> None:
    instances = [draw(configuration(), number) for number in range(24)]

    def objects() -> int:
        list(outcomes(instances, controller))
        gc.collect()
        return len(gc.get_objects())

    objects()
    before = objects()
    assert objects() - before < len(instances)
