"""Each rule from both sides of its tolerances, on a grid and on a turned network that is none."""

from __future__ import annotations

import pytest

from dubins_traffic.cars.state import Contact
from dubins_traffic.roads.network import RoadNetwork
from tests.judging import (
    CROSSINGS,
    EPS,
    GRID,
    REACH,
    RHO,
    ROADS,
    after,
    before,
    case,
    hold,
    judged,
    lanes_in,
    lanes_out,
    said,
)
from tests.rules_scripts import STAR, Frame, on_lane

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)
anybody = pytest.mark.parametrize("who", [0, 1], ids=["ego", "agent"])


def away(roads: RoadNetwork) -> tuple[float, ...]:
    """Return a place in a dead end's or bend's lane where a car is in nobody's way, too short-lived for E5."""
    return on_lane(roads, lanes_out(roads)[0], 2.0, -0.3)


def pair(roads: RoadNetwork, who: int, places: list[tuple[float, ...]]) -> list[Frame]:
    """Return a script in which one car takes `places` and the other is out of the way."""
    other = away(roads)
    return [[place, other] if who == 0 else [other, place] for place in places]


# Rule 1


@both
@anybody
def test_the_ego_stays_on_the_road_once_it_is_there(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    lateral = (-0.7, -0.6 + EPS, -0.6 - EPS, -0.7, -0.5, -0.7)
    script = pair(roads, who, [on_lane(roads, lane, 2.0, offset) for offset in lateral])
    expected = [("1.road", 0, 2, 2), ("1.road", 0, 5, 5)] if who == 0 else []
    assert said(judged(case(roads, 2), script)) == expected


def touch(tick: int, car: int, other: int, closing: tuple[float, float], moved: tuple[bool, bool]) -> Contact:
    return Contact(tick, tick / 10, car, other, 1.0, 2.0, 1.0, 0.0, closing, moved)


@both
def test_a_collision_is_the_egos_breach_and_the_guilty_agents(roads: RoadNetwork) -> None:
    script = hold(*(on_lane(roads, lanes_in(roads)[0], s, -0.3) for s in (1.8, 2.2, 2.6)), frames=9)
    run = {"rest_time": 30.0}
    hit = touch(3, 0, 1, (0.0, 0.2), (False, True))
    assert said(judged(case(roads, 3, **run), script, [hit])) == [("1.collision", 0, 3, 3), ("E2", 1, 3, 3)]
    ran_into = touch(4, 0, 1, (0.5, 0.0), (True, False))
    assert said(judged(case(roads, 3, **run), script, [ran_into])) == [("1.collision", 0, 4, 4)]
    others = touch(5, 1, 2, (0.1, 0.3), (True, True))
    assert said(judged(case(roads, 3, **run), script, [others])) == [("E2", 1, 5, 5), ("E2", 2, 5, 5)]
    post = touch(6, 1, -1, (0.1, 0.0), (True, False))
    assert said(judged(case(roads, 3, **run), script, [post])) == [("E2", 1, 6, 6)]
    assert said(judged(case(roads, 3, **run), script, [touch(6, 0, -1, (0.1, 0.0), (True, False))])) == [
        ("1.collision", 0, 6, 6)
    ]


@both
def test_who_touches_another_in_breach_is_found_guilty_from_the_poses(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]
    left, right = on_lane(roads, lane, 2.0, 0.3), on_lane(roads, lane, 2.3, -0.1)
    script = hold(right, left, frames=4)
    found = said(judged(case(roads, 2), script, [touch(2, 0, 1, (0.3, 0.3), (True, True))]))
    assert ("E2", 1, 2, 2) in found
    found = said(
        judged(case(roads, 2), hold(left, right, frames=4), [touch(2, 0, 1, (0.3, 0.3), (True, True))])
    )
    assert [entry for entry in found if entry[0] == "E2"] == [("E2", 1, 2, 2)]


# Rule 2


@both
@anybody
def test_nobody_is_left_without_a_reason(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    reach = (0.0, 0.05 - EPS, 0.05 + EPS, 0.2, EPS, -EPS, 0.05 - EPS, 0.2)
    script = pair(roads, who, [on_lane(roads, lane, 2.0, offset - RHO) for offset in reach])
    assert said(judged(case(roads, 2), script)) == [("2.left", who, 2, 2), ("2.left", who, 7, 7)]


@both
@anybody
def test_overtaking_is_a_reason_for_a_while(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    stands, starts = on_lane(roads, lane, 2.6, -0.3), on_lane(roads, lane, 1.6, -0.3)
    beside = on_lane(roads, lane, 1.6, 0.3)

    def script(frames_left: int) -> list[Frame]:
        mine = [starts] * 12 + [beside] * frames_left + [starts]
        return [[place, stands] if who == 0 else [stands, place] for place in mine]

    rules = {"rest_time": 60.0, "left_time": 3.0}
    assert said(judged(case(roads, 2, **rules), script(30))) == []
    assert said(judged(case(roads, 2, **rules), script(31))) == [("2.return", who, 42, 12)]
    assert said(judged(case(roads, 2, rest_time=60.0), script(100))) == []
    assert said(judged(case(roads, 2, rest_time=60.0), script(101))) == [("2.return", who, 112, 12)]


@both
@anybody
def test_what_stands_too_far_ahead_is_no_reason(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]

    def found(ahead: float) -> list[tuple[object, ...]]:
        stands = on_lane(roads, lane, 1.2 + ahead, -0.3)
        mine = [on_lane(roads, lane, 1.2, -0.3)] * 11 + [on_lane(roads, lane, 1.2, 0.0)]
        script = [[place, stands] if who == 0 else [stands, place] for place in mine]
        return said(judged(case(roads, 2), script))

    assert found(1.5 - EPS) == []
    assert found(1.5 + EPS) == [("2.left", who, 11, 11)]


@both
@anybody
def test_turning_round_on_the_road_breaks_rule_2(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    for back, expected in ((0.3 - EPS, []), (0.3 + EPS, [("2.left", who, 2, 2)])):
        places = [on_lane(roads, lane, s, -0.3) for s in (2.0, 2.5, 2.5 - back)]
        assert said(judged(case(roads, 2), pair(roads, who, places))) == expected


# Rule 3


def entering(roads: RoadNetwork, stop: int, gap: float = 0.3) -> list[tuple[float, ...]]:
    """Return a car that stands before the crossing for `stop` frames and is in it two frames later."""
    lane = lanes_in(roads)[0]
    return [before(roads, lane, gap)] * stop + [before(roads, lane, EPS), before(roads, lane, -EPS)]


@both
@anybody
def test_who_enters_has_stopped(roads: RoadNetwork, who: int) -> None:
    assert said(judged(case(roads, 2), pair(roads, who, entering(roads, 6)))) == []
    found = judged(case(roads, 2), pair(roads, who, entering(roads, 5)))
    assert said(found) == [("3.stop", who, 6, 6)]
    assert found[0].vertex == CROSSINGS[id(roads)]
    assert found[0].lane == lanes_in(roads)[0]
    assert (found[0].x, found[0].y) == before(roads, lanes_in(roads)[0], -EPS)[:2]


@both
@anybody
@pytest.mark.parametrize(("gap", "rules"), [(0.5 - EPS, []), (0.5 + EPS, ["3.stop"])])
def test_a_stop_counts_near_the_crossing(roads: RoadNetwork, who: int, gap: float, rules: list[str]) -> None:
    found = judged(case(roads, 2), pair(roads, who, entering(roads, 6, gap)))
    assert [breach.rule for breach in found] == rules


@both
@anybody
@pytest.mark.parametrize(("way", "rules"), [(0.025 - EPS, []), (0.025 + EPS, ["3.stop"])])
def test_a_stop_is_still(roads: RoadNetwork, who: int, way: float, rules: list[str]) -> None:
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])
    steps = [on_lane(roads, lane, length - 1.5 + way * k / 5, -0.3) for k in range(6)]
    places = [*steps, before(roads, lane, EPS), before(roads, lane, -EPS)]
    assert [breach.rule for breach in judged(case(roads, 2), pair(roads, who, places))] == rules


@both
@anybody
@pytest.mark.parametrize(("late", "rules"), [(1, ["3.order"]), (2, [])])
def test_who_enters_is_first_in_order(roads: RoadNetwork, who: int, late: int, rules: list[str]) -> None:
    """The other, on the right, is of the group if he comes at most 0.1 s later."""
    mine, right = entering(roads, 9), lanes_in(roads)[1]
    coming, there = on_lane(roads, right, 2.0, -0.3), before(roads, right, 0.3)
    script = [[place, there if k >= late else coming] for k, place in enumerate(mine)]
    script = script if who == 0 else [frame[::-1] for frame in script]
    found = judged(case(roads, 2), script)
    assert [(breach.rule, breach.car) for breach in found] == [(rule, who) for rule in rules]
    assert all(breach.tick == 10 for breach in found)


@both
@anybody
@pytest.mark.parametrize(("gap", "rules"), [(EPS, []), (-EPS, ["3.clear"])])
def test_who_enters_finds_the_crossing_clear(
    roads: RoadNetwork, who: int, gap: float, rules: list[str]
) -> None:
    """What counts is the frame before the entry."""
    mine, out = entering(roads, 8), lanes_out(roads)[1]
    inside, leaving, gone = after(roads, out, -0.4), after(roads, out, gap), after(roads, out, 0.5)
    other = [inside] * (len(mine) - 2) + [leaving, gone]
    script = [[a, b] if who == 0 else [b, a] for a, b in zip(mine, other, strict=True)]
    found = judged(case(roads, 2), script)
    assert said(found) == [(rule, who, 9, 9) for rule in rules]


@both
def test_who_enters_at_the_same_time_as_another_does_not_see_him(roads: RoadNetwork) -> None:
    one, two = lanes_in(roads)[:2]
    script = [[before(roads, one, gap), before(roads, two, gap)] for gap in (0.3,) * 6 + (EPS, -EPS)]
    assert said(judged(case(roads, 2), script)) == [("3.order", 0, 7, 7)]


@both
def test_an_entry_from_off_the_lane_breaks_rule_3(roads: RoadNetwork) -> None:
    """Backwards out of the exit lane into the crossing it came from, less than a turn."""
    out = lanes_out(roads)[0]
    places = [after(roads, out, gap) for gap in (-0.2, 0.1, -0.1)]
    assert [breach.rule for breach in judged(case(roads, 1), [[place] for place in places])] == ["3.stop"]


def test_bends_and_dead_ends_are_no_crossings() -> None:
    lane = STAR.arms(STAR.vertex((1, 1)))[0]
    length = float(STAR.lengths[lane // 2])
    script = [[on_lane(STAR, lane, length - distance, -0.3)] for distance in (1.5, 1.3, 1.1, 0.9)]
    assert judged(case(STAR, 1), script) == []
    corner = next(lane for lane in range(GRID.lanes) if len(GRID.arms(GRID.lane_ends(lane)[1])) == 2)
    script = [[on_lane(GRID, corner, 5.0 - distance, -0.3)] for distance in (1.5, 1.3, 1.1, 0.9)]
    assert judged(case(GRID, 1), script) == []
    assert [breach.rule for breach in judged(case(GRID, 1, crossing_degree=2), script)] == ["3.stop"]


# E3


@both
@anybody
def test_e3_who_is_first_goes_before_his_second_new_ticket(roads: RoadNetwork, who: int) -> None:
    """Stopped at 5, new tickets at 35 and at 65."""
    waits = before(roads, lanes_in(roads)[0], 0.3)

    def found(frames: int) -> list[tuple[object, ...]]:
        script = pair(roads, who, [waits] * frames)
        return [entry for entry in said(judged(case(roads, 2, exit_time=600.0), script)) if entry[0] != "E5"]

    expected = [("E3.tickets", 1, 65, 5), ("E3.enter", 1, 105, 5)] if who == 1 else []
    assert found(65) == []
    assert found(66) == expected[:1]
    assert found(140) == expected


@both
def test_e3_who_is_first_goes_within_ten_seconds(roads: RoadNetwork) -> None:
    def found(frames: int, **rules: float) -> list[tuple[object, ...]]:
        script = [[away(roads), place] for place in entering(roads, frames)]
        return said(judged(case(roads, 2, tickets=9, **rules), script))

    assert found(104) == []
    assert found(105) == [("E3.enter", 1, 105, 5)]
    assert found(24, enter_time=2.0) == []
    assert found(25, enter_time=2.0) == [("E3.enter", 1, 25, 5)]


@both
def test_e3_waits_for_a_clear_crossing(roads: RoadNetwork) -> None:
    waits, inside = before(roads, lanes_in(roads)[0], 0.3), after(roads, lanes_out(roads)[1], -0.5)
    rules = {"tickets": 9, "enter_time": 2.0}
    assert said(judged(case(roads, 2, **rules), hold(inside, waits, frames=60))) == []
    script = [[inside if k < 20 else after(roads, lanes_out(roads)[1], 0.5), waits] for k in range(60)]
    assert said(judged(case(roads, 2, **rules), script)) == [("E3.enter", 1, 40, 20)]


# E4


@both
@anybody
def test_e4_a_disc_with_a_free_exit_is_left_in_time(roads: RoadNetwork, who: int) -> None:
    out = lanes_out(roads)[1]

    def found(frames: int) -> list[tuple[object, ...]]:
        places = [after(roads, out, -EPS)] * frames + [after(roads, out, EPS)]
        return said(judged(case(roads, 2), pair(roads, who, places)))

    assert found(50) == []
    assert found(51) == ([("E4", 1, 50, 0)] if who == 1 else [])


@both
def test_e4_no_exit_is_free_with_somebody_near_in_each(roads: RoadNetwork) -> None:
    inside = on_lane(roads, lanes_out(roads)[0], 0.1, -0.1)

    def found(gap: float, lateral: float = -0.3) -> list[tuple[object, ...]]:
        others = [after(roads, lane, 0.4) for lane in lanes_out(roads)]
        others[1] = after(roads, lanes_out(roads)[1], gap, lateral)
        script = hold(others[0], inside, *others[1:], frames=31)
        return said(judged(case(roads, len(others) + 1, exit_time=3.0), script))

    assert found(0.8 - EPS) == []
    assert found(0.8 + EPS) == [("E4", 1, 30, 0)]
    assert found(0.5, RHO - 0.05 - EPS) == [
        entry for entry in found(0.5, RHO - 0.05 - EPS) if entry[0] == "2.left"
    ]
    assert ("E4", 1, 30, 0) in found(0.5, RHO - 0.05 + EPS)


def test_e4_in_a_dead_end_who_is_nearer_to_the_way_out_leaves_first() -> None:
    out = STAR.arms(STAR.vertex((0, 1)))[0]
    deep, near = on_lane(STAR, out, 0.1, -0.3), on_lane(STAR, out, 0.6, -0.3)
    far = on_lane(STAR, lanes_star(), 2.0, -0.3)
    assert said(judged(case(STAR, 3, rest_time=600.0), hold(far, deep, near, frames=51))) == [
        ("E4", 2, 50, 0)
    ]
    assert said(judged(case(STAR, 2), hold(near, deep, frames=51))) == []


def lanes_star() -> int:
    return STAR.arms(STAR.vertex((2, 1)))[0]


def test_e4_from_disc_to_disc_the_time_begins_anew() -> None:
    roads = RoadNetwork(((0, 0, 1, 0),), 3.0, (0.0, 0.0, 0.0), (1, 2))
    places = [on_lane(roads, 0, 0.5, -0.3)] * 30 + [on_lane(roads, 0, 2.5, -0.3)] * 30
    assert said(judged(case(roads, 2), [[on_lane(roads, 1, 1.5, -0.3), place] for place in places])) == []


# E5


@both
@anybody
def test_e5_nobody_stands_for_long_with_a_free_way(roads: RoadNetwork, who: int) -> None:
    """Stands at 10, when a second has passed."""
    place = on_lane(roads, lanes_out(roads)[1], 2.2, -0.3)
    other = on_lane(roads, lanes_out(roads)[2], 2.2, -0.3)

    def found(frames: int, **rules: float) -> list[tuple[object, ...]]:
        wiggles = [on_lane(roads, lanes_out(roads)[2], 2.2 + 0.1 * (k % 3), -0.3) for k in range(frames)]
        script = [[place, wiggle] if who == 0 else [other, place] for wiggle in wiggles]
        return said(judged(case(roads, 2, **rules), script))

    expected = [("E5", 1, 610, 10)] if who == 1 else []
    assert found(610) == []
    assert found(611) == expected
    assert found(40, rest_time=3.0) == []
    assert found(41, rest_time=3.0) == ([("E5", 1, 40, 10)] if who == 1 else [])


@both
def test_e5_the_way_is_free_beyond_a_metre_and_a_half(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]

    def found(ahead: float) -> list[tuple[object, ...]]:
        script = hold(on_lane(roads, lane, 1.2 + ahead, -0.3), on_lane(roads, lane, 1.2, -0.3), frames=41)
        return said(judged(case(roads, 2, rest_time=3.0), script))

    assert found(1.5 - EPS) == []
    assert found(1.5 + EPS) == [("E5", 1, 40, 10)]


@both
def test_e5_a_queue_is_no_free_way(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])
    waits = on_lane(roads, lane, length - 1.6, -0.3)
    behind = on_lane(roads, lane, length - 2.9, -0.3)
    inside = after(roads, lanes_out(roads)[1], -0.5)
    script = [[inside, waits, behind] for _ in range(80)]
    assert said(judged(case(roads, 3, rest_time=3.0), script)) == []


# E6


@both
@anybody
def test_e6_a_goal_is_free_again_in_time(roads: RoadNetwork, who: int) -> None:
    v = roads.lane_ends(lanes_out(roads)[1])[1]
    goal, lane = roads.intersections[v], lanes_out(roads)[1]
    length = float(roads.lengths[lane // 2])
    inside, outside = (on_lane(roads, lane, length - 1.0 + step, 0.0) for step in (EPS, -EPS))

    def found(frames: int, **rules: float) -> list[tuple[object, ...]]:
        script = pair(roads, who, [outside, *[inside] * frames, outside])
        found = said(judged(case(roads, 2, [goal], exit_time=999.0, rest_time=999.0, **rules), script))
        return [entry for entry in found if entry[0] == "E6"]

    assert found(600) == []
    assert found(601) == ([("E6", 1, 601, 1)] if who == 1 else [])
    assert found(30, goal_time=3.0) == []
    assert found(70, goal_time=3.0) == ([("E6", 1, 31, 1)] if who == 1 else [])


def test_e6_names_who_has_been_there_longest_of_those_who_relieve_each_other() -> None:
    lane = STAR.arms(STAR.vertex((1, 1)))[0]
    length, goal = float(STAR.lengths[lane // 2]), STAR.intersections[STAR.lane_ends(lane)[1]]
    inside, outside = on_lane(STAR, lane, length - 0.5, -0.3), on_lane(STAR, lane, length - 1.5, -0.3)
    ego = on_lane(STAR, lanes_star(), 2.0, -0.3)
    script = [[ego, inside if k < 20 else outside, inside if k >= 15 else outside] for k in range(40)]
    found = judged(case(STAR, 3, [goal], goal_time=3.0), script)
    assert said(found) == [("E6", 2, 30, 0)]
    assert found[0].vertex == STAR.vertex(goal)
    gap = [[ego, inside if k != 20 else outside, outside] for k in range(45)]
    assert [
        entry for entry in said(judged(case(STAR, 3, [goal], goal_time=3.0), gap)) if entry[0] == "E6"
    ] == []


def test_what_is_not_asked_for_is_not_judged() -> None:
    script = hold(on_lane(GRID, 0, 2.0, 0.3), on_lane(GRID, 1, 2.0, 0.3), frames=3)
    instance = case(GRID, 2)
    assert len(judged(instance, script)) == 2
    silent = type(instance.problem)(
        **{name: getattr(instance.problem, name) for name in instance.problem.__slots__} | {"rules": {}}
    )
    bare = type(instance)(
        **{name: getattr(instance, name) for name in instance.__slots__} | {"problem": silent}
    )
    assert judged(bare, script, [touch(1, 0, 1, (0.1, 0.1), (True, True))]) == []


def test_reach_is_what_the_helpers_think() -> None:
    assert pytest.approx(1.0 + 0.177) == REACH
