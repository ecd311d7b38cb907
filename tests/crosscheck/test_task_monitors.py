"""The rules stated as formulas, judged by monitors, against the referee: the same rules broken at the same frames."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import pytest

from dubins_traffic.cars.body import Car, DiscObstacle, Rectangle
from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.rules.breach_log import RULES
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Referee
from dubins_traffic.rules.valuation import Valuation
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.judging import Judging
from tests.judge_reference import Judge
from tests.judging import GRID, ROADS, after, before, case, frames_of, lanes_in, lanes_out
from tests.minute import a_minute
from tests.rules_scripts import KITE, on_lane, wander
from tests.signals import Key, first_breaches, judged, stated, summed

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)


def compared(instance: Instance, frames: Frames, *, waits: bool = False) -> dict[Key, int]:
    """Return what is broken first and when, on which monitors and referee agree; so they do on the last verdicts.

    With `waits` some e-agents wait for the ego (docs/rules.md#waits). The formula of E6 knows no such pause, so it
    falls no later than the referee says.
    """
    formulas = stated(instance)
    breaches, _ = Referee([instance]).judge(frames)
    found, last = judged(instance, formulas, frames)
    said = first_breaches(instance, formulas, breaches)
    if waits:
        goals = {key: said.pop(key, len(frames)) for key in tuple(found) if key[0] == "E6"}
        assert all(found[key] <= tick for key, tick in goals.items())
        assert {key: tick for key, tick in found.items() if key not in goals} == said
    else:
        assert found == said
    judging = Judging()
    judging.begin(instance)
    judging.frames(frames)
    verdict = judging.result()
    assert verdict is not None
    parts = summed(instance, last)
    if instance.problem.rules.get("exceptions"):
        del parts["E1"]  # whose verdict tells of clocks that run, which the formula with exceptions doesn't
    if waits:
        del parts["E6"]
    assert parts == {part: verdict.formulas[part] for part in parts}
    return found


def rules_of(found: dict[Key, int], car: int = 0) -> set[str]:
    return {rule for rule, n, _ in found if n == car}


QUICK = {
    "left_time": 2.0,
    "enter_time": 3.5,
    "exit_time": 2.0,
    "rest_time": 4.0,
    "journey_start_time": 4.0,
    "goal_time": 5.0,
    "goal_gap": 0.0,
}
QUICK |= {"linger_time": 4.0, "shared_time": 2.0}
HURRIED = {**QUICK, "exit_time": 4.0}
"""Quick rules that the cars, at their speed, could still keep."""
BREAKS = {"rolls": 0.3, "left": 0.3, "blocks": 0.5, "tailgates": 0.3, "parks": 1.0, "parks_for": 20.0}


def town(rules: dict[str, float] | None = None, *, breaks: bool = False) -> Configuration:
    """Return the shipped `town`; with `breaks` its e-agents break rules, and one stands for ever."""
    document = a_minute("town").to_document()
    document |= {"duration": 40.0, "rules": rules or True}
    if breaks:
        document["network"] = {"random": {"intersections": 6, "segments": 7}}
        document["e-agents"] = [
            {"type": "lawful", "name": "rogue", "count": 4, "parameters": BREAKS},
            {"type": "parked", "name": "van", "parameters": {"vacates_after": None}},
            {"type": "parked", "name": "cab", "parameters": {"vacates_after": 12}},
        ]
    return load_config(document)


def record(folder: Path, configuration: Configuration, controller: str, number: int) -> tuple[Instance, Frames]:
    file = folder / f"{controller}{number}.mcap"
    run_trial(draw(configuration, 5, number), controller, record=file, overwrite=True)
    kept = read(str(file))
    return kept.instance, kept.frames


def all_rules(found: Iterable[dict[Key, int]], own: bool) -> set[str]:
    return {rule for one in found for rule, car, _ in one if (car == EGO) == own}


def test_monitors_and_referee_agree_on_records(tmp_path: Path) -> None:
    simple, lanes = (
        [compared(*record(tmp_path, town(), controller, number)) for number in range(6)]
        for controller in ("simple", "lanes")
    )
    assert {"1.road", "2.left", "3.stop"} <= all_rules(simple, own=True)
    assert "3.stop" in all_rules(lanes, own=True)
    assert "1.road" not in all_rules(lanes, own=True)


def test_monitors_and_referee_agree_on_those_who_break_the_assumption(tmp_path: Path) -> None:
    configuration = town(HURRIED, breaks=True)
    found = [
        compared(*record(tmp_path, configuration, controller, number), waits=True)
        for controller in ("rules", "simple")
        for number in range(6)
    ]
    rules = {"2.left", "2.return", "3.stop", "3.clear", "E4", "E5", "E6"}
    assert all_rules(found, own=False) >= rules


def test_what_is_forgiven(tmp_path: Path) -> None:
    found: list[dict[Key, int]] = []
    for exceptions in (1, 3):
        configuration = town({**HURRIED, "exceptions": exceptions, "exception_time": 15.0}, breaks=True)
        found += [compared(*record(tmp_path, configuration, "lanes", number), waits=True) for number in range(6)]
    assert "E1" in all_rules(found, own=False)
    assert "3.stop" not in all_rules(found, own=False)


def test_monitors_and_referee_agree_on_scripts_that_break_everything() -> None:
    found: list[dict[Key, int]] = []
    for roads, seeds in ((KITE, range(20, 26)), (GRID, range(20, 24))):
        goals = [roads.intersections[0], roads.intersections[2]]
        instance = case(roads, 6, goals, **{**QUICK, "enter_time": 4.0, "goal_time": 4.0})
        found += [compared(instance, frames_of(wander(roads, 6, 1500, seed, odd=seed % 2 == 0))) for seed in seeds]
    assert all_rules(found, own=False) >= set(RULES[2:]) - {"E2"}
    assert all_rules(found, own=True) >= set(RULES[1:7]) - {"3.order"}


@pytest.mark.parametrize("car", [Car(), Car(body=Rectangle(0.5, 0.26))], ids=["disc", "rectangle"])
def test_the_propositions_of_the_assumption_as_the_reference_finds_them(car: Car) -> None:
    instance = case(KITE, 5, [KITE.intersections[0]], **QUICK)
    obstacle = DiscObstacle(*on_lane(KITE, 0, 1.6, -0.4)[:2], 0.15)
    instance = replace(instance, problem=replace(instance.problem, car=car, obstacles=(obstacle,)))
    script = wander(KITE, 5, 600, 23, odd=True)
    past = Judge(instance, script).past
    names = instance.names
    words = [f"{word}_{name}" for word in ("exit", "stays", "renewed") for name in names[1:]]
    words += [f"{word}_{name}" for name in names for word in ("stands", "lingers", "way")]
    values = dict(zip(words, Valuation(instance, words).values(frames_of(script)).T, strict=True))
    tickets = RuleParameters.from_mapping(instance.problem.rules).tickets
    for n, name in enumerate(names):
        for word in ("stands", "lingers", "way"):
            fact = "goes" if word == "way" else word
            assert values[f"{word}_{name}"].tolist() == [facts[n][fact] for facts in past]
        if n == EGO:
            continue
        assert values[f"exit_{name}"].tolist() == [facts[n]["exit"] for facts in past]
        renewed = [
            facts[n]["stopped"] and facts[n]["forfeits"] == tickets + 1 and facts[n]["ticket"] == tick
            for tick, facts in enumerate(past)
        ]
        assert values[f"renewed_{name}"].tolist() == renewed
    for word in ("exit", "stays", "renewed", "stands", "lingers", "way"):
        assert any(values[one].any() for one in words if one.startswith(word)), word


@both
@pytest.mark.parametrize("late", [1, 2])
def test_order(roads, late) -> None:
    one, right = lanes_in(roads)[:2]
    mine = [before(roads, one, 0.3)] * 9 + [before(roads, one, gap) for gap in (1e-6, -1e-6)]
    coming, there = on_lane(roads, right, 2.0, -0.3), before(roads, right, 0.3)
    script = [[place, there if k >= late else coming] for k, place in enumerate(mine)]
    instance = case(roads, 2)
    assert rules_of(compared(instance, frames_of(script))) == ({"3.order"} if late == 1 else set())


@both
@pytest.mark.parametrize("gap", [1e-6, -1e-6])
def test_clear(roads, gap) -> None:
    one, out = lanes_in(roads)[0], lanes_out(roads)[1]
    mine = [before(roads, one, 0.3)] * 8 + [before(roads, one, 1e-6), before(roads, one, -1e-6)]
    other = [after(roads, out, -0.4)] * 8 + [after(roads, out, gap), after(roads, out, 0.5)]
    instance = case(roads, 2)
    frames = frames_of([list(cars) for cars in zip(mine, other, strict=True)])
    assert rules_of(compared(instance, frames)) == (set() if gap > 0 else {"3.clear"})


@pytest.mark.parametrize(("frames", "rules"), [(10, {"2.left"}), (11, {"2.left", "2.return"})])
def test_left_for_long(frames, rules) -> None:
    instance = case(GRID, 1, left_time=1.0)
    place = on_lane(GRID, lanes_in(GRID)[0], 2.0, 0.0)
    assert rules_of(compared(instance, frames_of([[place]] * frames))) == rules


@pytest.mark.parametrize(("frames", "rules"), [(15, set()), (16, {"E3.enter"})])
def test_first_and_never_enters(frames, rules) -> None:
    """An e-agent stops at 0.5 s and is first from then on."""
    instance = case(GRID, 2, enter_time=1.0)
    one, two = lanes_in(GRID)[:2]
    far, near = on_lane(GRID, one, 1.8, -0.3), before(GRID, two, 0.3)
    found = compared(instance, frames_of([[far, near]] * frames))
    assert rules_of(found, car=1) == rules
