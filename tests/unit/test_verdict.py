"""Verdicts: who moved first, who excuses whom, what is satisfied; live, from records, and on the command line."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from experiments.free_flow import free_flow
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.cars.state import Contact, Observation, Pose
from dubins_traffic.cli.main import main
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import EAgent, Instance
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.reader import read
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Breach
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sandbox import owner_of
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.score import score
from dubins_traffic.scoring.verdict import Verdict, is_near
from dubins_traffic.viewer.marks import breach_marks
from tests.judging import GRID, ROADS, before, case, frames_of, lanes_in, lanes_out
from tests.minute import a_minute
from tests.recordings import blocks
from tests.rules_scripts import KITE, STAR, Frame, on_lane

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)


def verdict(
    instance: Instance,
    script: Sequence[Frame],
    contacts: Sequence[Contact] = (),
    size: int = 10,
    *,
    end: End | None = End.DURATION,
    planned: int | None = None,
) -> Verdict:
    """Return the verdict on a script, fed in blocks of `size` frames; of `planned` ticks, by default those it has."""
    ticks = len(script) - 1
    judging = Judging()
    duration = (ticks if planned is None else planned) / instance.problem.rate
    judging.begin(replace(instance, duration=duration))
    for block in blocks(frames_of(script, instance.problem.rate, contacts), size):
        judging.frames(block)
    if end is not None:
        judging.end(Ending(end, ticks))
    found = judging.result()
    assert found is not None
    return found


def left_at(roads: RoadNetwork, lane: int, frames: int, *ticks: int, s: float = 2.0) -> list[tuple[float, ...]]:
    """Return a car that reaches over the centre line at some frames."""
    return [on_lane(roads, lane, s, 0.0 if k in ticks else -0.3) for k in range(frames)]


def duel(roads: RoadNetwork, ego: int, agent: int, frames: int = 40, **rules: float) -> Verdict:
    """Return the verdict when ego and e-agent are left, each at one frame, or never (-1)."""
    one, two = lanes_in(roads)[:2]
    cars = left_at(roads, one, frames, ego), left_at(roads, two, frames, agent)
    return verdict(case(roads, 2, **rules), [list(frame) for frame in zip(*cars, strict=True)])


@both
def test_the_environment_moves_first(roads: RoadNetwork) -> None:
    assert duel(roads, 12, -1).verdict == "violated"
    assert duel(roads, 12, 13).verdict == "violated"
    assert duel(roads, 12, 12).verdict == "excused"
    assert duel(roads, 12, 11).verdict == "excused"
    assert duel(roads, -1, 11).verdict == "satisfied"
    assert [duel(roads, ego, 11).clean for ego in (-1, 12, 5)] == [True, False, False]


CONTROLLERS_OWN = {
    "gave_up", "controller_fault", "deadline", "peer_silent", "peer_lost", "peer_flood", "peer_garbage",
    "out_of_time", "out_of_memory", "output_flood",
}  # fmt: skip


@pytest.mark.parametrize("end", End)
def test_a_trial_that_its_controller_ended_is_never_clean(end: End) -> None:
    roads = ROADS["grid"]
    one, two = lanes_in(roads)[:2]
    cars = left_at(roads, one, 40), left_at(roads, two, 40)
    found = verdict(case(roads, 2), [list(frame) for frame in zip(*cars, strict=True)], end=end)
    assert found.violations == ()
    by_controller = end.value in CONTROLLERS_OWN
    assert found.clean == (end == End.DURATION)
    assert found.cut == (not by_controller and end != End.DURATION)
    assert (owner_of(end) == "submission") == (by_controller or end in (End.DURATION, End.COLLISION))


class Raises:
    """Drives for three ticks, then raises."""

    def start(self, problem: object) -> None:
        pass

    def act(self, observation: Observation) -> tuple[float, float]:
        if observation.tick == 3:
            raise RuntimeError("out of ideas")
        return 0.0, 0.0


def test_alone_and_in_a_batch_who_raises_is_not_clean() -> None:
    configuration = a_minute("junction")
    together = run_batch(configuration, Raises, trials=2, seed=1).outcomes
    for outcome in together:
        alone = run_trial(outcome.instance, Raises())
        assert outcome.ending.end == alone.ending.end == "controller_fault"
        for found in (outcome.score.verdict, alone.score.verdict):
            assert found is not None
            assert (found.clean, found.verdict, found.violations) == (False, "unfinished", ())


@both
def test_an_excuse_says_who_what_when_and_where(roads: RoadNetwork) -> None:
    excuse = duel(roads, 12, 11).excuse
    assert excuse is not None
    assert (excuse.assumption, excuse.violation.rule, excuse.violation.car) == ("E1", "2.left", "agent0")
    assert (excuse.violation.time, excuse.violation.tick, excuse.violation.since) == (1.1, 11, 1.1)
    x, y, _, _ = on_lane(roads, lanes_in(roads)[1], 2.0, 0.0)
    assert (excuse.violation.where.x, excuse.violation.where.y) == (x, y)
    x0, y0, x1, y1 = excuse.violation.where.segment or ()
    assert roads.lane_ends(lanes_in(roads)[1]) == (roads.vertex((x0, y0)), roads.vertex((x1, y1)))
    assert duel(roads, 12, -1).excuse is None


@pytest.mark.parametrize("turn", [0.0, 0.7], ids=["grid", "turned"])
def test_an_excuse_says_whether_the_ego_could_have_seen(turn: float) -> None:
    """The other is in sight, 5 m or nearer, at frame 3 only."""

    def sensed(tick: int, way: float, **rules: float) -> bool:
        roads = RoadNetwork(RoadNetwork.grid(2, 5, 5.0).segments, 5.0, (turn, -turn, turn), (2, 5))
        ego = left_at(roads, roads.arms(roads.vertex((0, 0)))[0], 60, tick)
        x, y, c, s = ego[0]
        agent = [(x + (way if k == 3 else 9.0) * c, y + (way if k == 3 else 9.0) * s, c, s) for k in range(60)]
        agent[0] = on_lane(roads, 2, 2.0, 0.3)
        found = verdict(case(roads, 2, **rules), [list(frame) for frame in zip(ego, agent, strict=True)])
        assert found.excuse is not None
        return found.excuse.sensed

    near, far = 5.0 - 1e-6, 5.0 + 1e-6
    assert sensed(13, near, witness_time=1.0)
    assert not sensed(13, far, witness_time=1.0)
    assert not sensed(14, near, witness_time=1.0)
    assert sensed(14, near)


def chase(ego: Sequence[int], agent: Sequence[int], sight: Sequence[int], **rules: float) -> Verdict:
    """Return the verdict when ego and e-agent are left at some frames, and the e-agent is in sight only at `sight`."""
    roads = RoadNetwork.grid(2, 8, 5.0)
    lane, far = (roads.arms(roads.vertex((x, 0)))[0] for x in (0, 6))
    script = []
    for k in range(60):
        beside = lane if k in sight else far
        other = on_lane(roads, beside, 3.0 if k in sight else 2.0, 0.0 if k in agent else -0.3)
        script.append([on_lane(roads, lane, 2.0, 0.0 if k in ego else -0.3), other])
    return verdict(case(roads, 2, **rules), script)


def test_near_asks_each_breach_of_the_ego_for_one_near_it() -> None:
    quick = {"witness_time": 1.0}
    assert chase([20], [10], [10], **quick).near is True, "as far back as may be"
    assert chase([20], [20], [20], **quick).near is True, "in the same frame"
    assert chase([20], [9], [9], **quick).near is False, "too long ago"
    assert chase([20], [9], [9]).near is True, "ten seconds unless the problem says otherwise"
    assert chase([20], [12], [13], **quick).near is False, "in sight, and not when it broke the rule"
    assert chase([20, 40], [12], [12], **quick).near is False, "the second breach has none"
    assert chase([20, 40], [12, 35], [12, 35], **quick).near is True
    assert chase([20], [5, 15], [15], **quick).near is True, "another breach than that of the excuse"


def test_near_is_said_of_who_is_excused_only() -> None:
    assert chase([5], [20], [20]).verdict == "violated"
    assert chase([5], [20], [20]).near is None
    assert chase([], [20], [20]).near is None
    assert chase([20], [12], [12]).to_json()["near"] is True


@given(
    st.lists(st.tuples(st.integers(0, 30), st.integers(0, 3), st.booleans()), max_size=12),
    st.integers(0, 8),
)
@settings(max_examples=200, deadline=None, derandomize=True)
def test_near_is_as_defined(found: list[tuple[int, int, bool]], back: int) -> None:
    breaches = [Breach("2.left", car, tick, tick, 0.0, 0.0, -1, -1) for tick, car, _ in sorted(found)]
    seen = {(car, tick) for tick, car, is_seen in found if is_seen}
    expected = all(
        any(o.car > 0 and t.tick - back <= o.tick <= t.tick and (o.car, o.tick) in seen for o in breaches)
        for t in breaches
        if t.car == 0
    )
    assert is_near(breaches, back, lambda car, tick: (car, tick) in seen) == expected


def test_the_assumption_may_fall_after_the_ego_or_without_it() -> None:
    assert duel(GRID, 5, 20).assumption_broken
    assert duel(GRID, -1, 20).assumption_broken
    assert not duel(GRID, 5, -1).assumption_broken
    assert not duel(GRID, 5, 20, assume_e1=0).assumption_broken


@both
def test_exceptions_are_forgiven_for_a_time(roads: RoadNetwork) -> None:
    one, two = lanes_in(roads)[:2]

    def ruling(*ticks: int, **rules: float) -> str:
        cars = left_at(roads, one, 60, 55), left_at(roads, two, 60, *ticks)
        script = [list(frame) for frame in zip(*cars, strict=True)]
        return verdict(case(roads, 2, exception_time=3.0, **rules), script).verdict.value

    assert ruling(5) == "excused"
    assert ruling(5, exceptions=1) == "violated"
    assert ruling(5, 34, exceptions=1) == "excused"
    assert ruling(5, 35, exceptions=1) == "violated"
    assert ruling(5, 15, 25, exceptions=2) == "excused"


def test_an_entry_against_two_parts_of_rule_3_is_one_exception() -> None:
    inside = on_lane(GRID, lanes_out(GRID)[1], 0.5, -0.3)
    entry = [before(GRID, lanes_in(GRID)[0], gap) for gap in (0.4, 0.2, -0.1, -0.2)]
    script = [[inside, place] for place in entry]
    found = verdict(case(GRID, 2, exceptions=1), script)
    assert [violation.rule for violation in found.violations] == ["3.stop", "3.clear"]
    assert found.formulas["E1"] == "presumably true"
    assert verdict(case(GRID, 2), script).formulas["E1"] == "false"


def test_no_exceptions_are_made_of_other_parts() -> None:
    hit = Contact(5, 0.5, 1, -1, 0.0, 0.0, 1.0, 0.0, (0.1, 0.0), (True, False))
    cars = left_at(GRID, lanes_in(GRID)[0], 20, 12), left_at(GRID, lanes_in(GRID)[1], 20, -1)
    script = [list(frame) for frame in zip(*cars, strict=True)]
    found = verdict(case(GRID, 2, exceptions=9), script, [hit])
    assert found.verdict == "excused"
    assert found.excuse is not None
    assert found.excuse.assumption == "E2"
    assert verdict(case(GRID, 2, assume_e2=0), script, [hit]).verdict == "violated"


def test_what_is_not_assumed_excuses_nothing() -> None:
    assert duel(GRID, 12, 5, assume_e1=0).verdict == "violated"
    assert "E1" not in duel(GRID, 12, 5, assume_e1=0).formulas
    with pytest.raises(InputError, match=r"assume_e1.*0 or 1"):
        RuleParameters(assume_e1=2)


def dead_end(roads: RoadNetwork) -> int:
    """Return a lane that ends in a dead end."""
    return next(lane for lane in range(roads.lanes) if len(roads.arms(roads.lane_ends(lane)[1])) == 1)


def visits(
    frames: int,
    *,
    visit: Sequence[int],
    goals: Sequence[tuple[int, int]],
    roads: RoadNetwork = STAR,
    **rules: float,
) -> Verdict:
    """Return the verdict when the ego is in a dead end at some frames, and in the last one's disc at others."""
    lane = dead_end(roads)
    inside = on_lane(roads, lane, float(roads.lengths[lane // 2]) - 0.8, -0.3)
    elsewhere = (*roads.points[-1].tolist(), 1.0, 0.0)
    script = [[inside if k in visit else elsewhere] for k in range(frames)]
    return verdict(case(roads, 1, goals, **rules), script)


@pytest.mark.parametrize("roads", [STAR, KITE], ids=["grid", "kite"])
def test_satisfied_needs_every_goal_and_short_gaps(roads: RoadNetwork) -> None:
    goal = roads.intersections[roads.lane_ends(dead_end(roads))[1]]
    other = next(point for point in roads.intersections if point != goal)

    def ruling(visit: Sequence[int], goals: Sequence[tuple[int, int]], **rules: float) -> str:
        return visits(50, visit=visit, goals=goals, roads=roads, **rules).verdict.value

    assert ruling([10, 30], [goal]) == "satisfied"
    assert ruling([10, 30], [goal], gap_share=20 / 49) == "satisfied"
    assert ruling([10, 30], [goal], gap_share=20 / 49 - 1e-9) == "unfinished"
    assert ruling([20], [goal], gap_share=1.0) == "unfinished", "one visit"
    assert ruling([0, 20], [goal], gap_share=1.0) == "unfinished", "one visit after the start"
    assert ruling([0, 20, 40], [goal]) == "satisfied"
    assert ruling([], [goal]) == "unfinished"
    assert ruling([10], [goal, other]) == "unfinished"
    assert ruling([], []) == "satisfied"
    found = visits(50, visit=[10, 30], goals=[goal], roads=roads)
    assert (found.rounds, found.longest_gap_s) == (2, 2.0)
    once = free_flow(case(roads, 1, [goal])).round_time
    assert found.recurrent
    assert found.gap_limit_s == pytest.approx(0.5 * 4.9)
    assert visits(50, visit=[10], goals=[goal], roads=roads, gap_share=1e9).gap_limit_s == 10.0 * once
    assert ruling([10, 30], [goal], gap_rounds=2.0 / once + 1e-9) == "satisfied"
    assert ruling([10, 30], [goal], gap_rounds=2.0 / once - 1e-9) == "unfinished"


@pytest.mark.parametrize("end", [*(end for end in End if end is not End.DURATION), None], ids=str)
def test_who_ends_before_the_time_is_not_satisfied(end: End | None) -> None:
    script = [[on_lane(GRID, lanes_in(GRID)[0], 2.0, -0.3)]] * 20
    assert verdict(case(GRID, 1), script).verdict == "satisfied"
    assert verdict(case(GRID, 1), script, end=end).verdict == "unfinished"
    assert verdict(case(GRID, 1), script, planned=20).verdict == "unfinished", "a tick is missing"
    rude = [[on_lane(GRID, lanes_in(GRID)[0], 2.0, 0.0)]] * 20
    assert verdict(case(GRID, 1), rude, end=end).verdict == "violated"


def test_formulas_have_four_values() -> None:
    goal = STAR.intersections[STAR.lane_ends(dead_end(STAR))[1]]
    name = f"1.goal {goal[0]} {goal[1]}"
    assert visits(50, visit=[10], goals=[goal]).formulas[name] == "presumably false"
    assert visits(50, visit=[10, 49], goals=[goal]).formulas[name] == "presumably true"
    assert visits(50, visit=[10], goals=[goal]).to_json()["edition"] == 3
    assert visits(50, visit=[10, 48, 49], goals=[goal]).formulas[name] == "presumably false"
    late = duel(GRID, 39, 39).formulas
    assert (late["2.left"], late["2.return"], late["3.stop"]) == (
        "false",
        "presumably false",
        "presumably true",
    )
    early = duel(GRID, 20, -1, linger_time=1.0).formulas
    assert (early["2.left"], early["2.return"]) == ("false", "presumably true")
    assert early["E1"] == "presumably true"
    assert early["E5"] == "presumably true"
    waits = [[on_lane(GRID, lanes_out(GRID)[0], 2.0, -0.3), before(GRID, lanes_in(GRID)[1], 0.3)]] * 10
    assert verdict(case(GRID, 2), waits).formulas["E3"] == "presumably false"
    assert set(late) == {
        "1.collision", "1.road", "2.left", "2.return", "2.turn", "3.stop", "3.order", "3.clear",
        "E1", "E2", "E3", "E4", "E5", "E6",
    }  # fmt: skip


def test_faults_are_found_again_whatever_a_record_says() -> None:
    hit = Contact(5, 0.5, 0, 1, 0.0, 0.0, 1.0, 0.0, (0.0, 0.3), (False, True), (True, False))
    cars = left_at(GRID, lanes_in(GRID)[0], 20), left_at(GRID, lanes_in(GRID)[1], 20)
    found = verdict(case(GRID, 2), [list(frame) for frame in zip(*cars, strict=True)], [hit])
    assert [(entry.at_fault, entry.partner_at_fault) for entry in found.collisions] == [(False, True)]
    assert found.verdict == "excused"


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_how_frames_are_cut_does_not_matter(size: int) -> None:
    cars = left_at(GRID, lanes_in(GRID)[0], 60, 12), left_at(GRID, lanes_in(GRID)[1], 60, 11, 14)
    script = [list(frame) for frame in zip(*cars, strict=True)]
    assert verdict(case(GRID, 2), script, size=size) == verdict(case(GRID, 2), script)


def test_a_problem_on_which_the_rules_are_not_defined_is_refused_with_the_place() -> None:
    short = RoadNetwork(STAR.segments, 2.8, STAR.transform, STAR.shape)
    with pytest.raises(InputError, match=r"segments\[0\]: .*too short.*2\.8"):
        Judging().begin(case(short, 1))
    blind = case(STAR, 1)
    with pytest.raises(InputError, match="sensing_radius"):
        Judging().begin(replace(blind, problem=replace(blind.problem, sensing_radius=2.0)))
    Judging().begin(replace(blind, problem=replace(blind.problem, sensing_radius=2.0, rules={})))


# Through the simulator


def drawn(trial: int = 0, seconds: float = 40.0) -> Instance:
    """Return a trial of the demo that is judged."""
    found = draw(load_config("demo"), 3, trial)
    rules = RuleParameters().to_mapping()
    return replace(found, duration=seconds, problem=replace(found.problem, rules=rules))


class Stands:
    """A controller that stays where it is."""

    def start(self, problem: Any) -> None: ...

    def act(self, _observation: Any) -> tuple[float, float]:
        return 0.0, 0.0


def scripted(commands: list[list[float]], start: tuple[float, ...], seconds: float) -> Instance:
    """Return a judged trial with an ego that stands and one e-agent with a script."""
    found = drawn(seconds=seconds)
    agent = EAgent("scripted", "agent0", "scripted", {"commands": commands})
    problem = replace(found.problem, e_agents=("agent0",), goals=())
    ego = on_lane(problem.network, 0, 1.5, -0.3)
    return replace(found, problem=problem, e_agents=(agent,), starts=(Pose(*ego), Pose(*start)))


def test_a_scripted_agent_that_rolls_through_a_stop_and_one_that_does_not() -> None:
    network = drawn().problem.network
    v = next(v for v in range(len(network.points)) if len(network.arms(v)) == 4)
    lane = next(lane ^ 1 for lane in network.arms(v) if lane // 2 != 0)
    start = on_lane(network, lane, 1.3, -0.3)
    rolls = run_trial(scripted([[2.0, 0.5, 0.0], [1.0, 0.0, 0.0]], start, 2.0), Stands()).score.verdict
    stops = [[0.3, 0.5, 0.0], [0.8, 0.0, 0.0], [1.7, 0.5, 0.0]]
    halts = run_trial(scripted(stops, start, 2.8), Stands()).score.verdict
    assert rolls is not None
    assert halts is not None
    assert [violation.rule for violation in rolls.violations] == ["3.stop"]
    entry = (1.7 - (1.177**2 - 0.3**2) ** 0.5) / 0.5
    assert 0.0 < rolls.violations[0].time - entry <= 1 / 30
    assert rolls.violations[0].where.intersection == network.intersections[v]
    assert halts.violations == ()
    assert (rolls.verdict, halts.verdict) == ("satisfied", "satisfied")


@pytest.mark.parametrize("controller", ["simple", "lanes"])
def test_live_equals_rescored_and_the_built_in_controllers_break_rules(controller: str, tmp_path: Path) -> None:
    path = tmp_path / "trial.mcap"
    live = run_trial(drawn(), controller, record=path).score
    again = score(read(path))
    assert live.verdict is not None
    assert again.verdict == live.verdict
    assert json.loads(json.dumps(live.to_json()["verdict"])) == again.to_json()["verdict"]
    broken = {violation.rule for violation in live.verdict.violations if violation.car == "ego"}
    assert "3.stop" in broken
    assert ("2.left" in broken) == (controller == "simple")
    assert not live.verdict.clean


def test_check_prints_the_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    judged, silent = tmp_path / "judged.mcap", tmp_path / "silent.mcap"
    instance = drawn(seconds=10.0)
    run_trial(instance, "simple", record=judged)
    run_trial(replace(instance, problem=replace(instance.problem, rules={})), "simple", record=silent)
    assert main(["check", str(judged), str(silent), "--json"]) == 0
    first, second = json.loads(capsys.readouterr().out)["records"]
    keys = [
        "record", "end", "clean", "cut", "verdict", "near", "violations", "rounds", "counted_rounds", "longest_gap_s",
    ]  # fmt: skip
    assert list(first) == keys
    assert (first["record"], first["clean"]) == (str(judged), False)
    assert first["verdict"] in ("violated", "excused")
    assert list(first["violations"][0]) == ["rule", "car", "time", "since", "where"]
    assert [second[key] for key in keys[2:7]] == [None, None, None, None, []]
    assert main(["check", str(judged), str(silent)]) == 0
    text = capsys.readouterr().out
    assert first["verdict"] in text
    assert {entry["rule"] for entry in first["violations"]} <= set(text.split())
    assert "not judged" in text
    assert main(["check", str(tmp_path / "none.mcap")]) == 2
    assert main(["replay", str(judged), "-o", str(tmp_path / "page.html")]) == 0
    assert "ego breaks 3.stop" in (tmp_path / "page.html").read_text()
    assert main(["score", str(judged)]) == 0


def test_breaches_are_marks_of_a_replay() -> None:
    found = duel(GRID, 12, 11)
    marks = breach_marks(case(GRID, 2), found.violations)
    assert [(mark.kind, mark.time, mark.car, mark.since) for mark in marks] == [
        ("breach", 1.1, 1, None),
        ("breach", 1.2, 0, None),
    ]
    assert marks[1].point == on_lane(GRID, lanes_in(GRID)[0], 2.0, 0.0)[:2]
