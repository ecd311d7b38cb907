"""A fork of a running trial goes on to the bit as the trial does, and shares nothing with it."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from copy import copy, deepcopy
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
import pytest
from experiments.counter import Case
from experiments.counter import instance as counter_instance
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import dubins_traffic as dt
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.engine.batch_kernel import World
from dubins_traffic.engine.controlled import AskedGroup
from dubins_traffic.engine.group import Group
from dubins_traffic.errors import DubinsTrafficError, InputError
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import Capabilities, Controller
from dubins_traffic.runs.single import Trial
from dubins_traffic.scoring.score import Scorer
from dubins_traffic.sessions.remote import hand_over
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.lines import Lines
from dubins_traffic.transports.link import Link
from dubins_traffic.trial.forking import FORKED
from tests.forks import KINDS, WORLDS, Kept, arrays_in, configuration, plain
from tests.property.test_batch import Wheel
from tests.witness import Witness

SEED = 5


def begun(instance: Instance) -> Trial:
    """Return a trial with sinks that go on in forks."""
    return Trial(instance, sinks=[Kept(), Scorer()])


def wheel(tick: int, phase: float) -> tuple[float, float]:
    """Return the command of an ego that swings about the road, at `tick`."""
    return 0.6, 1.5 * np.sin(0.1 * tick + phase).item()


def swung(trial: Trial, ticks: int, phase: float = 0.0) -> None:
    """Let the ego swing about for some ticks, or to the end."""
    last = trial.tick + ticks
    while trial.ending is None and trial.tick < last:
        trial.step(wheel(trial.tick, phase))


def came_to(trial: Trial) -> tuple[Any, ...]:
    """Return all that sinks and senses have of a trial."""
    kept, scorer = trial.sinks
    assert isinstance(kept, Kept)
    assert isinstance(scorer, Scorer)
    return trial.tick, trial.ending, repr(trial.observation), kept.told(), plain(scorer.result())


def check_forks(instance: Instance, at: int, later: int) -> None:
    """Fork a trial, and its fork, and compare all with a trial that nobody has forked."""
    alone = begun(instance)
    swung(alone, 10**6)
    wanted = came_to(alone)
    first = begun(instance)
    swung(first, at)
    second, spoilt = first.fork(), first.fork()
    swung(spoilt, 10**6, phase=2.0)
    swung(second, later)
    third = second.fork()
    for trial in (third, first, second):
        swung(trial, 10**6)
        assert came_to(trial) == wanted
    assert spoilt.ending is not None


@settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    kinds=st.lists(st.sampled_from(KINDS), unique_by=lambda kind: kind["name"], max_size=4),
    world=st.sampled_from(sorted(WORLDS)),
    rules=st.booleans(),
    at=st.integers(0, 55),
    later=st.integers(0, 8),
    trial=st.integers(0, 3),
)
def test_a_fork_and_a_fork_of_it_equal_a_trial_that_nobody_has_forked(
    kinds: Sequence[Any], world: str, rules: bool, at: int, later: int, trial: int
) -> None:
    check_forks(draw(configuration(kinds, world, rules, seconds=2), SEED, trial), at, later)


def test_a_trial_and_its_fork_share_no_array() -> None:
    instance = draw(configuration(KINDS, "laser", rules=True), SEED, 0)
    trial = begun(instance)
    swung(trial, 40)
    fork = trial.fork()
    swung(fork, 1)
    swung(trial, 1)
    here, there = arrays_in(trial), arrays_in(fork)
    assert here.keys() == there.keys()
    assert len(here) > 100
    for name, array in here.items():
        assert not any(np.may_share_memory(array, other) for other in there.values()), name


@pytest.mark.parametrize("at", [0, 45])
def test_a_team_that_plays_a_counterstrategy_goes_on_in_a_fork(at: int) -> None:
    case = Case(2, 2, 1, ("E1", "E2", "E3", "E4", "E5", "E6"))
    check_forks(counter_instance(case, 1, 2.0), at, 5)


@pytest.mark.parametrize("controller", ["rules", "lanes", "simple", "lanes+shield", "synthesized"])
def test_a_copy_of_a_controller_goes_on_in_a_fork(controller: str) -> None:
    instance = draw(configuration(KINDS[2:3], "plain", rules=True, seconds=4), SEED, 0)
    trial, driver = begun(instance), controllers.load(controller)
    driver.start(instance.problem)
    driven(trial, driver, 50)
    fork, copied = trial.fork(), deepcopy(driver)
    driven(fork, copied, 10**6)
    driven(trial, driver, 10**6)
    assert came_to(fork) == came_to(trial)


def driven(trial: Trial, driver: Controller, ticks: int) -> None:
    """Let a controller that has been started drive for some ticks, or to the end."""
    last = trial.tick + ticks
    while trial.ending is None and trial.tick < last:
        command = driver.act(trial.observation)
        assert command is not None
        trial.advance(command)


def test_a_controller_by_name_drives_a_fork_to_its_end() -> None:
    trial = begun(draw(configuration(KINDS[:1], "plain", rules=True), SEED, 0))
    swung(trial, 10)
    ends = [trial.fork().run("rules") for _ in range(2)]
    assert ends[0] == ends[1]
    assert (ends[0].end, ends[0].ticks) == (dt.End.DURATION, 90)
    assert trial.tick == 10


def seeded(trial: Trial, seed: int) -> tuple[Any, ...]:
    fork = trial.fork(seed)
    swung(fork, 10**6)
    return came_to(fork)


def test_another_seed_draws_anew_what_is_random_from_here_on() -> None:
    trial = begun(draw(configuration(KINDS[3:4], "noise", rules=True, seconds=20), SEED, 0))
    swung(trial, 100)
    one, two, again = (seeded(trial, seed) for seed in (6, 7, 6))
    assert one == again
    assert one[3] != two[3]
    fork = trial.fork(6)
    assert fork.instance.seed == 6
    assert trial.instance.seed == SEED
    assert fork.observation.pose != trial.observation.pose, "noise is drawn anew"
    (kept, scorer) = fork.sinks
    assert isinstance(kept, Kept)
    assert isinstance(scorer, Scorer)
    swung(fork, 30)
    events = [event for block in kept.blocks for event in block.events]
    assert [(event.kind, event.tick) for event in events] == [(FORKED, 100)]
    assert scorer.result().seed == 6
    np.testing.assert_array_equal(kept.blocks[0].x, first_block(trial).x)


def first_block(trial: Trial) -> dt.Frames:
    kept = trial.sinks[0]
    assert isinstance(kept, Kept)
    return kept.blocks[0]


def test_the_seed_of_the_instance_is_no_other_seed() -> None:
    trial = begun(draw(configuration(KINDS[3:4], "noise", rules=True, seconds=3), SEED, 0))
    swung(trial, 20)
    assert seeded(trial, SEED) == seeded(trial, SEED)
    fork = trial.fork()
    swung(fork, 10**6)
    assert came_to(fork) == seeded(trial, SEED)


@pytest.mark.parametrize("at", [0, 1, 29, 30, 44])
def test_a_record_that_is_asked_for_is_that_of_the_whole_trial(at: int, tmp_path: Path) -> None:
    instance = draw(configuration(KINDS[:2], "plain", rules=True, seconds=3), SEED, 0)
    trial = Trial(instance, record=tmp_path / "trial.mcap")
    swung(trial, at)
    fork, bare = trial.fork(record=tmp_path / "fork.mcap"), trial.fork()
    assert bare.sinks == ()
    again = fork.fork(record=tmp_path / "again.mcap")
    for own in (bare, again, trial, fork):
        swung(own, 10**6)
    found = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    assert set(found) == {"trial.mcap", "fork.mcap", "again.mcap"}
    assert len(set(found.values())) == 1


def test_a_fork_that_can_t_be_is_refused_and_the_trial_goes_on(tmp_path: Path) -> None:
    instance = draw(configuration(KINDS[:1], "plain", rules=True, seconds=2), SEED, 0)
    trial = Trial(instance)
    with pytest.raises(InputError, match="no record to continue"):
        trial.fork(record=tmp_path / "fork.mcap")
    with pytest.raises(InputError, match="seed"):
        trial.fork(-1)
    (tmp_path / "there.mcap").write_bytes(b"mine")
    with Trial(instance, record=tmp_path / "trial.mcap") as recorded:
        with pytest.raises(InputError, match="another seed"):
            recorded.fork(3, record=tmp_path / "fork.mcap")
        with pytest.raises(InputError, match="exists"):
            recorded.fork(record=tmp_path / "there.mcap")
        with pytest.raises(InputError, match="the record of the trial"):
            recorded.fork(record=tmp_path / "trial.mcap", overwrite=True)
        swung(recorded.fork(record=tmp_path / "again.mcap"), 10**6)
        swung(recorded, 10**6)
    assert (tmp_path / "trial.mcap").read_bytes() == (tmp_path / "again.mcap").read_bytes()
    assert (tmp_path / "there.mcap").read_bytes() == b"mine"
    assert not (tmp_path / "fork.mcap").exists()
    swung(trial, 10**6)
    with pytest.raises(DubinsTrafficError, match="ended"):
        trial.fork()


class Elsewhere(Embedded):
    """A simulator that does not say that it can go on twice."""

    capabilities = Capabilities(batched=True, deterministic=True, lockstep=True)


def test_e_agents_that_programs_elsewhere_drive_are_refused() -> None:
    instance = draw(configuration(KINDS[2:3], "plain", rules=False), SEED, 0)
    link = Link(Lines(), Lockstep())
    with (
        closing(link.transport),
        Trial(hand_over(instance, ["nemesis"]), link=link) as trial,
        pytest.raises(InputError, match="elsewhere"),
    ):
        trial.fork()


def test_a_simulator_that_can_t_go_on_twice_is_refused() -> None:
    instance = draw(configuration((), "plain", rules=False), SEED, 0)
    with pytest.raises(InputError, match="simulator"):
        Trial(instance, simulator=Elsewhere()).fork()


def group_of(kinds: Sequence[Any], world: str, rules: bool, keeps_rules: bool, seconds: int = 2) -> Group:
    """Return a group of three trials."""
    config = configuration(kinds, world, rules, seconds)
    return Group([draw(config, SEED, trial) for trial in range(3)], keeps_rules=keeps_rules)


def finished(group: Group, keeps_rules: bool) -> list[Any]:
    """Run a group to the end; return what came of its trials."""
    while len(group.active):
        if not keeps_rules:
            for b in group.active.tolist():
                group.commands[b, 0] = wheel(int(group.ticks[b]), 0.0)
        group.advance()
    found = group.outcomes(range(len(group.instances)), "any")
    return [(own.ending, plain(own.score)) for own in found]


@settings(max_examples=25, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(
    kinds=st.lists(st.sampled_from(KINDS), unique_by=lambda kind: kind["name"], max_size=4),
    world=st.sampled_from(sorted(set(WORLDS) - {"formulas", "noise", "lossy", "laser"})),
    rules=st.booleans(),
    keeps_rules=st.booleans(),
    at=st.integers(0, 55),
    trials=st.lists(st.integers(0, 2), min_size=1, max_size=4),
)
def test_forks_of_some_trials_of_a_batch_equal_the_trials(
    kinds: Sequence[Any], world: str, rules: bool, keeps_rules: bool, at: int, trials: list[int]
) -> None:
    wanted = finished(group_of(kinds, world, rules, keeps_rules), keeps_rules)
    group = group_of(kinds, world, rules, keeps_rules)
    for _ in range(at):
        for b in group.active.tolist():
            if not keeps_rules:
                group.commands[b, 0] = wheel(int(group.ticks[b]), 0.0)
        group.advance()
    forks = group.fork(trials)
    spoilt = forks.fork([len(trials) - 1] * 2, seeds=[1, 2])
    again = forks.fork([0, 0])
    assert not shared(forks, again)
    spoilt.commands[:] = 0.7, 1.0
    spoilt.finish()
    assert finished(again, keeps_rules) == [wanted[trials[0]]] * 2
    assert finished(forks, keeps_rules) == [wanted[b] for b in trials]
    assert finished(group, keeps_rules) == wanted


def shared(one: Group, other: Group) -> list[str]:
    """Return the names of the arrays that change and that two groups share.

    What the shields of free cars know of roads and obstacles changes as little as that of the group.
    """
    constant = ("stage", "distance", "cycle", "script", "mask", "whim")
    ground = (".traffic.roads.", ".shields.obstacles.")
    there = arrays_in(changing(other)).values()
    return [
        name
        for name, array in arrays_in(changing(one)).items()
        if not name.endswith(constant)
        and not any(part in name for part in ground)
        and any(np.may_share_memory(array, its) for its in there)
    ]


def changing(group: Group) -> dict[str, Any]:
    """Return the tables of a group but for those of its roads, and what it has found so far."""
    tables = zip(World.field_names, group.world, strict=True)
    mine = {name: value for name, value in tables if name not in ("roads", "beside", "labelling", "judging")}
    return mine | {"commands": group.commands}


def test_forks_of_a_batch_with_other_seeds_go_other_ways() -> None:
    many = [{**KINDS[0], "count": 3}, {**KINDS[3], "count": 4}]
    group = group_of(many, "plain", rules=True, keeps_rules=True, seconds=14)
    group.advance(20)
    forks = group.fork([1] * 6, seeds=[SEED, SEED, 7, 7, 8, 10])
    assert [own.seed for own in forks.instances] == [SEED, SEED, 7, 7, 8, 10]
    forks.advance(10**6)
    with pytest.raises(DubinsTrafficError, match="ended"):
        forks.fork([2])
    group.advance(10**6)
    poses = [forks.state.x[b].tobytes() for b in range(6)]
    assert poses[0] == poses[1] == group.state.x[1].tobytes()
    assert poses[2] == poses[3]
    assert len(set(poses)) > 1


def test_forks_of_a_batch_of_so_many_cars_that_they_are_looked_for_in_cells() -> None:
    crowd = [{"type": "lawful", "name": "agent", "count": 28, "parameters": {"rolls": 0.3}}, *KINDS[5:6]]
    group = group_of(crowd, "obstacle", rules=True, keeps_rules=True, seconds=3)
    group.advance(25)
    forks = group.fork([2, 0])
    group.finish()
    forks.finish()
    assert [plain(own.score) for own in forks.outcomes([0, 1], "rules")] == [
        plain(own.score) for own in group.outcomes([2, 0], "rules")
    ]


def asked(group: AskedGroup, ticks: int = 10**6) -> dict[int, Any]:
    """Let the controllers of a group drive for some ticks, or to the end; return what came of trials, by number."""
    found: dict[int, Any] = {}
    while len(group.active) and ticks > 0:
        ticks -= 1
        group.decide()
        before = set(group.active.tolist())
        group.advance()
        ended = group.fresh("any")
        gone = sorted(before - set(group.active.tolist()))
        assert len(gone) == len(ended)
        found |= {b: (own.ending, plain(own.score)) for b, own in zip(gone, ended, strict=True)}
    return found


@pytest.mark.parametrize("world", ["noise", "lossy", "laser"])
@pytest.mark.parametrize("controller", ["rules", "lanes+shield"])
def test_forks_of_trials_whose_controllers_are_asked_equal_the_trials(world: str, controller: str) -> None:
    config = configuration(KINDS[:4], world, True, seconds=3)
    own = AskedGroup([draw(config, SEED, k) for k in range(2)], partial(controllers.load, controller), None)
    assert asked(own, 40) == {}
    forks = own.fork([1, 0, 1])
    others = own.fork([1, 1], seeds=[SEED, SEED + 1])
    wanted = asked(own)
    assert asked(forks) == {0: wanted[1], 1: wanted[0], 2: wanted[1]}
    found = asked(others)
    assert found[0] == wanted[1]
    assert found[1] != wanted[1]


def test_a_controller_of_whole_batches_does_not_go_on_twice() -> None:
    config = configuration((), "plain", rules=False)
    own = AskedGroup([draw(config, SEED, 0)], Wheel, Wheel())
    with pytest.raises(DubinsTrafficError, match="a BatchController can't be forked"):
        own.fork([0])


class Copied(Witness):
    """A metric that tells all that it has seen, and can be copied."""

    def __deepcopy__(self, memo: object) -> Self:
        twin = copy(self)
        twin._hash = self._hash.copy()
        return twin


@pytest.mark.parametrize("seed", [SEED, SEED + 1])
def test_metrics_of_ones_own_go_on_in_forks(seed: int) -> None:
    instance = draw(configuration(KINDS[3:4], "plain", rules=True, seconds=4), SEED, 0)
    trial, group = (
        Trial(instance, sinks=[Scorer([Copied])]),
        Group([instance], keeps_rules=False, metrics=[Copied]),
    )
    swung(trial, 40)
    for _ in range(40):
        group.commands[0, 0] = wheel(int(group.ticks[0]), 0.0)
        group.advance()
    fork, forks = trial.fork(seed), group.fork([0, 0], [seed, seed])
    swung(fork, 10**6)
    (scorer,) = fork.sinks
    assert isinstance(scorer, Scorer)
    wanted = plain(scorer.result())
    assert [own for _, own in finished(forks, keeps_rules=False)] == [wanted, wanted]


def test_what_can_t_be_copied_is_named() -> None:
    instance = draw(configuration((), "plain", rules=False), SEED, 0)
    with pytest.raises(InputError, match="can't be copied"):
        Trial(instance, sinks=[Scorer([Witness])]).fork()
    with pytest.raises(InputError, match="can't be copied"):
        Group([instance], keeps_rules=False, metrics=[Witness]).fork([0])
