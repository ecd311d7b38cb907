"""The shield on cases by hand: what it lets through, what it makes of the rest, and what it says of it."""

from __future__ import annotations

import hashlib
import math
import os
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers import registry
from dubins_traffic.controllers.shield import Shield
from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.protocols import Ending
from dubins_traffic.record.reader import read
from dubins_traffic.record.sink import Frames
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.scoring.score import Score
from dubins_traffic.shield.filter import Intervention, ShieldFilter
from dubins_traffic.shield.tables import Overtakes
from tests.unit.test_law import TURN, W, broken, car, on_grid, turned

Act = Callable[[Observation], Any]
START = turned(1.6, -W)
NAN = float("nan")


class Drives:
    """A controller that asks for what a function says, and keeps what it has seen."""

    def __init__(self, act: Act) -> None:
        self.seen: list[Observation] = []
        self._act = act

    def start(self, problem: Problem) -> None:
        """Nothing of the problem matters."""

    def act(self, observation: Observation) -> Any:
        """Ask."""
        self.seen.append(observation)
        return self._act(observation)


class Noting(Shield):
    """A shield that keeps what it did."""

    def __init__(self, controller: Any, *, overtakes: Overtakes = "sure") -> None:
        super().__init__(controller, overtakes=overtakes)
        self.found: list[Intervention] = []

    def act(self, observation: Observation) -> Command | None:
        """Note whether the shield steps in."""
        given = super().act(observation)
        if self.shield_filter.intervention is not None and given is not None:
            self.found.append(self.shield_filter.intervention)
        return given


def steer(observation: Observation, bearing: float, speed: float = 0.7) -> tuple[float, float]:
    """Return the command that drives on while it turns to a direction."""
    _, _, c, s = observation.pose
    cross = c * math.sin(bearing + TURN) - s * math.cos(bearing + TURN)
    return speed, 8.0 * cross


def shielded(instance: Instance, act: Act) -> tuple[Score, list[Intervention]]:
    """Return the score of a trial under the shield, and what the shield did."""
    shield = Noting(Drives(act))
    return run_trial(instance, shield).score, shield.found


def reasons(found: Sequence[Intervention]) -> set[str]:
    """Return why a shield stepped in."""
    return {one.reason for one in found}


def in_the_way() -> dict[str, Any]:
    """Return an obstacle in the ego's lane."""
    x, y, _ = turned(3.2, -W)
    return {"disc": {"x": x, "y": y, "radius": 0.15}}


@pytest.mark.parametrize("overtakes", ["sure", "law"])
def test_rules_drives_as_without_a_shield(overtakes: Overtakes) -> None:
    """It is let across the centre line past an obstacle with nobody near, and by the law's leave past a car."""
    if overtakes == "sure":
        instance = on_grid([], 60.0, START, obstacles=[in_the_way()])
    else:
        agents = [car("lawful", f"c{k}", goes="wander") for k in range(3)]
        parked = car("parked", "parked", turned(3.0, -W), vacates_after=None)
        instance = on_grid([*agents, parked], 60.0, START)
    shield = Shield("rules", overtakes=overtakes)
    with_it, without = run_trial(instance, shield).score, run_trial(instance, "rules").score
    assert shield.shield_filter.count == 0
    assert with_it.driven == without.driven
    assert with_it.driven.distance_m > 20.0


def test_what_is_not_sure_is_not_done() -> None:
    """By default no car is passed, and no obstacle beside which one could come; never means never."""
    parked = car("parked", "parked", turned(3.0, -W), vacates_after=None)
    near = car("parked", "parked", turned(4.0, -W), vacates_after=None)
    cases: list[tuple[Instance, Overtakes]] = [
        (on_grid([parked], 10.0, START), "sure"),
        (on_grid([near], 10.0, START, obstacles=[in_the_way()]), "sure"),
        (on_grid([], 10.0, START, obstacles=[in_the_way()]), "never"),
    ]
    for instance, overtakes in cases:
        shield = Noting("rules", overtakes=overtakes)
        score = run_trial(instance, shield).score
        assert broken(score, "ego") == set()
        assert reasons(shield.found) == {"2.left"}
        assert score.driven.distance_m < 2.0


CASES: dict[str, tuple[Sequence[float], Act, str]] = {
    "straight on": (START, lambda _: (0.7, 0.0), "3.stop"),
    "into the other lane": (START, lambda seen: steer(seen, 0.6), "2.left"),
    "off the road": (START, lambda seen: steer(seen, -0.9), "1.road"),
    "backward": (turned(3.2, -W), lambda _: (-0.7, 0.0), "2.turn"),
    "back into the disc": (turned(7.25, -W), lambda _: (-0.1, 0.0), "3.stop"),
    "round": (turned(3.0, -W), lambda seen: steer(seen, 3.0, 0.2), "2.turn"),
}


@pytest.mark.parametrize("case", CASES)
def test_a_command_that_would_break_a_rule_is_not_let_through(case: str) -> None:
    start, act, expected = CASES[case]
    instance = on_grid([], 20.0, start)
    score, found = shielded(instance, act)
    assert found[0].reason == expected
    assert broken(score, "ego") == set()
    assert broken(run_trial(instance, Drives(act)).score, "ego")


def test_a_disc_is_entered_on_ones_turn() -> None:
    """Who asks to drive straight on is stopped at the line, gets a ticket, and may go."""
    score, found = shielded(on_grid([], 6.0, START), lambda seen: steer(seen, 0.0))
    assert broken(score, "ego") == set()
    assert score.driven.distance_m > 3.0
    assert reasons(found) == {"3.stop"}
    waited = [one.tick for one in found if one.given.speed == 0.0]
    assert 10 <= len(waited) <= 20


def test_nothing_is_run_into() -> None:
    parked = car("parked", "parked", turned(3.0, -W), vacates_after=None)
    x, y, _ = turned(3.0, -W)
    disc = {"disc": {"x": x, "y": y, "radius": 0.15}}
    for instance in (on_grid([parked], 10.0, START), on_grid([], 10.0, START, obstacles=[disc])):
        score, found = shielded(instance, lambda _: (0.7, 0.0))
        assert (score.collisions, broken(score, "ego")) == ((), set())
        assert reasons(found) == {"1.collision"}
        assert score.min_clearance_m is not None
        assert score.min_clearance_m < 0.06


def test_who_is_run_into_is_not_at_fault() -> None:
    rammer = {
        "type": "scripted",
        "name": "rammer",
        "start": turned(2.6, -W, math.pi),
        "parameters": {"commands": [[10.0, 0.7, 0.0]]},
    }
    score, _ = shielded(on_grid([rammer], 8.0, START), lambda _: (0.7, 0.0))
    assert [one.at_fault for one in score.collisions] == [False]
    assert score.verdict is not None
    assert score.verdict.excuse is not None


def test_numbers_that_are_none_mean_standing() -> None:
    values = [(NAN, 0.0), (0.3, math.inf), (-math.inf, NAN)]
    score, found = shielded(on_grid([], 1.0, START), lambda seen: values[seen.tick % 3])
    assert (score.end, score.driven.distance_m) == ("duration", 0.0)
    assert [one.given for one in found] == [Command(0.0, 0.0)] * 30
    assert reasons(found) == {"not finite numbers"}


def test_commands_beyond_the_bounds_are_left_to_the_simulator() -> None:
    score, found = shielded(on_grid([], 1.0, START), lambda _: (1e300, 0.0))
    assert (found, score.driven.distance_m) == ([], pytest.approx(0.7))


def test_what_is_done_is_no_farther_from_what_was_asked_than_standing() -> None:
    def apart(one: tuple[float, float], other: tuple[float, float]) -> float:
        return math.hypot((one[0] - other[0]) / 0.7, (one[1] - other[1]) / math.pi)

    for _, act, _ in CASES.values():
        _, found = shielded(on_grid([], 10.0, START), act)
        for one in found:
            asked = (one.asked[0], min(max(one.asked[1], -math.pi), math.pi))
            assert apart(asked, one.given) <= apart(asked, (0.0, 0.0)) + 1e-12


def test_the_law_takes_over_to_pass_what_stands() -> None:
    """Who steers round an obstacle is let across the centre line only as the law passes, and is back in time."""
    instance = on_grid([], 40.0, START, obstacles=[in_the_way()])
    shield = Noting("lanes")
    score = run_trial(instance, shield).score
    assert broken(score, "ego") == set()
    assert reasons(shield.found) == {"2.left", "2.return", "3.stop"}
    assert score.driven.distance_m > 15.0


def test_a_car_that_starts_on_the_left_is_brought_back() -> None:
    score, found = shielded(on_grid([], 8.0, turned(3.0, 0.0)), lambda _: (0.0, 0.0))
    assert broken(score, "ego") == {"2.left"}
    assert reasons(found) == {"2.return"}
    assert score.verdict is not None
    assert len([one for one in score.verdict.violations if one.car == "ego"]) == 1


def test_without_an_observation_in_between_nobody_backs_up() -> None:
    shield_filter, watch = ShieldFilter(), Drives(lambda _: (0.0, 0.0))
    instance = on_grid([], 1.0, turned(3.0, -W))
    run_trial(instance, watch)
    shield_filter.start(instance.problem)
    assert shield_filter.filter(watch.seen[0], (-0.3, 0.0)) == (-0.3, 0.0)
    assert shield_filter.filter(watch.seen[5], (-0.3, 0.0)) == (0.0, 0.0)
    assert shield_filter.filter(watch.seen[6], (0.3, 0.0)) == (0.3, 0.0)
    assert shield_filter.intervention is None
    assert shield_filter.count == 1


@pytest.mark.parametrize(("answer", "end"), [(None, "gave_up"), ("ab", "controller_fault")])
def test_what_is_no_command_ends_the_trial_as_without_a_shield(answer: Any, end: str) -> None:
    instance = on_grid([], 1.0, START)
    for driver in (Drives(lambda _: answer), Shield(Drives(lambda _: answer))):
        assert run_trial(instance, driver).ending.end == end


def test_what_a_controller_raises_is_its_fault() -> None:
    def fails(observation: Observation) -> tuple[float, float]:
        if observation.tick == 4:
            raise ValueError("lost")
        return 0.1, 0.0

    ending = run_trial(on_grid([], 1.0, START), Shield(Drives(fails))).ending
    assert (ending.end, ending.ticks) == ("controller_fault", 4)
    assert ending.detail.startswith("ValueError: lost at tick 4 (test_shield.py:")


def test_every_time_it_steps_in_is_an_event_of_the_record(tmp_path: Path) -> None:
    shield = Noting(Drives(lambda _: (0.7, 0.0)))
    result = run_trial(on_grid([], 8.0, START), shield, record=tmp_path / "one.mcap")
    record = read(result.record or "")
    events = [event for event in record.frames.events if event.kind == "shield"]
    assert [event.tick for event in events] == [one.tick for one in shield.found]
    assert {event.car for event in events} == {0}
    first = shield.found[0]
    assert events[0].detail == f"3.stop: asked (0.7, 0), given ({first.given.speed:.6g}, 0)"
    held = record.frames.command_speed[first.tick + 1, 0]
    assert held == first.given.speed


def test_names_with_a_shield(tmp_path: Path) -> None:
    assert isinstance(registry.load("rules+shield"), Shield)
    assert registry.shielded("rules") == registry.shielded("rules+shield") == "rules+shield"
    with pytest.raises(InputError, match="unknown controller"):
        registry.load("nobody+shield")
    assert registry.shielded("rules+shield:law") == "rules+shield:law"
    with pytest.raises(InputError, match="overtakes: not a way to overtake: got 'maybe'; expected sure, law"):
        registry.load("rules+shield:maybe")
    with pytest.raises(InputError, match="got ''"):
        registry.load("rules+shield:")
    with pytest.raises(InputError, match="got True"):
        ShieldFilter(overtakes=True)  # pyright: ignore[reportArgumentType]
    instance = on_grid([], 8.0, START)
    result = run_trial(instance, "simple+shield", record=tmp_path / "one.mcap")
    assert read(result.record or "").controller == "simple+shield"


def test_a_name_says_when_the_ego_overtakes() -> None:
    instance = on_grid([], 20.0, START, obstacles=[in_the_way()])
    driven = {
        how: run_trial(instance, f"rules+shield{how}").score.driven.distance_m
        for how in ("", ":sure", ":law", ":never")
    }
    assert driven[""] == driven[":sure"] == driven[":law"] > driven[":never"] + 5.0


def test_a_car_that_can_not_keep_the_rules_is_refused() -> None:
    instance = on_grid([], 1.0, START)
    bounds = replace(instance.problem.car.bounds, speed_min=0.1)
    problem = replace(instance.problem, car=replace(instance.problem.car, bounds=bounds))
    with pytest.raises(InputError, match="can't stop"):
        ShieldFilter().start(problem)


class Digest:
    """A sink that digests poses."""

    def begin(self, _instance: Instance) -> None:
        self.sum = hashlib.sha256()

    def frames(self, frames: Frames) -> None:
        self.sum.update(frames.x.tobytes() + frames.command_yaw_rate.tobytes())

    def end(self, _ending: Ending) -> None:
        pass


def digest() -> str:
    """Return a digest of a trial in which the shield steps in all the time."""
    parked = car("parked", "parked", turned(3.0, -W), vacates_after=None)
    sink = Digest()
    result: Result = run_trial(
        on_grid([parked, car("lawful", "other")], 3.0, START),
        Shield(Drives(lambda seen: (0.7, 2.0 * math.sin(seen.tick)))),
        sinks=[sink],
    )
    assert result.ending.end == "duration"
    return sink.sum.hexdigest()


def test_compiled_and_interpreted_shields_do_the_same() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", "from tests.unit.test_shield import digest; print(digest())"],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.strip() == digest()
