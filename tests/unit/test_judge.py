"""Rules 1 to 3 from both sides of their tolerances, on a grid and on a turned network that is none."""

from __future__ import annotations

import math

import pytest

from dubins_traffic.cars.state import Contact
from dubins_traffic.roads.network import RoadNetwork
from tests.judging import (
    CROSSINGS,
    EASED,
    EPS,
    GRID,
    REACH,
    RHO,
    ROADS,
    after,
    before,
    case,
    entering,
    hold,
    judged,
    lanes_in,
    lanes_out,
    pair,
    said,
)
from tests.rules_scripts import STAR, Frame, on_lane

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)
anybody = pytest.mark.parametrize("who", [0, 1], ids=["ego", "agent"])


# Rule 1


@both
@anybody
def test_a_car_stays_on_the_road_once_it_is_there(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    lateral = (-0.7, -0.6 + EPS, -0.6 - EPS, -0.7, -0.5, -0.7)
    script = pair(roads, who, [on_lane(roads, lane, 2.0, offset) for offset in lateral])
    assert said(judged(case(roads, 2), script)) == [("1.road", who, 2, 2), ("1.road", who, 5, 5)]


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
    found = said(judged(case(roads, 2), hold(left, right, frames=4), [touch(2, 0, 1, (0.3, 0.3), (True, True))]))
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
@pytest.mark.parametrize(
    ("away", "goes", "broken"),
    [(-EPS, 90, []), (EPS, 90, [(42, 12)]), (-EPS, 40, [(70, 40)])],
    ids=["stays near", "far", "drives off"],
)
def test_the_time_to_return_does_not_run_beside_who_has_moved(
    roads: RoadNetwork, who: int, away: float, goes: int, broken: list[tuple[int, int]]
) -> None:
    """What stands drives on in frame 20, stands again, and drives off in frame `goes`."""
    lane, gap = lanes_in(roads)[0], 2.0 * RHO + 0.8 + away
    mine = [on_lane(roads, lane, 1.6, -0.3)] * 12 + [on_lane(roads, lane, 1.6, 0.3)] * 78
    places = (2.3, 1.6 + math.sqrt(gap * gap - 0.36), 3.0)
    stood, on, off = (on_lane(roads, lane, place, -0.3) for place in places)
    its = ([stood] * 20 + [on] * (goes - 20) + [off] * 90)[:90]
    script = [[own, other] if who == 0 else [other, own] for own, other in zip(mine, its, strict=True)]
    found = said(judged(case(roads, 2, rest_time=60.0, left_time=3.0), script))
    assert found == [("2.return", who, *times) for times in broken]


@both
@anybody
def test_who_is_left_without_a_reason_is_not_hemmed_in(roads: RoadNetwork, who: int) -> None:
    lane = lanes_in(roads)[0]
    left, beside = (
        on_lane(roads, lane, 1.6, 0.3),
        [on_lane(roads, lane, 1.6 + 0.1 * (k % 3), -0.3) for k in range(40)],
    )
    script = [[left, other] if who == 0 else [other, left] for other in beside]
    found = said(judged(case(roads, 2, left_time=3.0), script))
    assert found == [("2.left", who, 0, 0), ("2.return", who, 30, 0)]


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
    for back, expected in ((0.3 - EPS, []), (0.3 + EPS, [("2.left", who, 2, 2), ("2.turn", who, 2, 2)])):
        places = [on_lane(roads, lane, s, -0.3) for s in (2.0, 2.5, 2.5 - back)]
        assert said(judged(case(roads, 2), pair(roads, who, places))) == expected


@both
@anybody
@pytest.mark.parametrize(("back", "turns"), [(0.3 - EPS, False), (0.3 + EPS, True)])
def test_who_backs_out_of_overtaking_turns_only_behind_where_that_began(
    roads: RoadNetwork, who: int, back: float, turns: bool
) -> None:
    lane = lanes_in(roads)[0]
    stands = on_lane(roads, lane, 2.6, -0.3)
    ways = [1.5] * 11 + [1.5 + 0.05 * k for k in range(1, 25)] + [2.7 - 0.05 * k for k in range(1, 24)]
    mine = [on_lane(roads, lane, s, -0.3 if s < 1.55 else 0.1) for s in (*ways, 1.5 - back, 1.6)]
    script = [[place, stands] if who == 0 else [stands, place] for place in mine]
    found = [rule for rule, *_ in said(judged(case(roads, 2, left_time=60.0), script))]
    assert ("2.turn" in found) == turns


@both
@anybody
@pytest.mark.parametrize(("beyond", "broken"), [(EASED, False), (EPS, True)])
def test_limits_are_eased_for_who_would_be_in_breach(roads: RoadNetwork, who: int, beyond: float, broken: bool) -> None:
    """By less than a thousandth of a thousandth of a millimetre: of the road, of the lane, and of the place to stop."""
    lane = lanes_in(roads)[0]
    edge = pair(roads, who, [on_lane(roads, lane, 2.0, offset) for offset in (-0.5, -0.6 - beyond)])
    assert bool(judged(case(roads, 2), edge)) == broken
    over = pair(roads, who, [on_lane(roads, lane, 2.0, offset) for offset in (-0.3, 0.05 - RHO + beyond)])
    assert bool(judged(case(roads, 2), over)) == broken
    stop = pair(roads, who, entering(roads, 6, 0.5 + beyond))
    assert bool(judged(case(roads, 2), stop)) == broken


# Rule 3


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
def test_who_enters_finds_the_crossing_clear(roads: RoadNetwork, who: int, gap: float, rules: list[str]) -> None:
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


def test_what_is_not_asked_for_is_not_judged() -> None:
    script = hold(on_lane(GRID, 0, 2.0, 0.3), on_lane(GRID, 1, 2.0, 0.3), frames=3)
    instance = case(GRID, 2)
    assert len(judged(instance, script)) == 2
    silent = type(instance.problem)(
        **{name: getattr(instance.problem, name) for name in instance.problem.__slots__} | {"rules": {}}
    )
    bare = type(instance)(**{name: getattr(instance, name) for name in instance.__slots__} | {"problem": silent})
    assert judged(bare, script, [touch(1, 0, 1, (0.1, 0.1), (True, True))]) == []


def test_reach_is_what_the_helpers_think() -> None:
    assert pytest.approx(1.0 + 0.177) == REACH
