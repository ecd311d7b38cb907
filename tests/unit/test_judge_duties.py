"""What e-agents owe, E3 to E6, from both sides of its tolerances, on a grid and on a turned network that is none."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from dubins_traffic.cars.body import Body, Bounds, Car, Disc, DiscObstacle, Rectangle
from dubins_traffic.roads.network import RoadNetwork
from tests.judge_reference import Judge
from tests.judging import (
    EASED,
    EPS,
    GRID,
    RHO,
    ROADS,
    after,
    away,
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
from tests.rules_scripts import STAR, on_lane

BESIDE = 2.0 * RHO + 0.1 + RHO - 0.6
"""How far out of a lane a centre is whose body just leaves room for another and 0.1 m, metres."""

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)
anybody = pytest.mark.parametrize("who", [0, 1], ids=["ego", "agent"])


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
def test_e3_backing_out_and_stopping_again_is_no_new_wait(roads: RoadNetwork) -> None:
    """A car stops at 5, backs out of the approach at 8, stops at 17, and at 29, before which it has entered or not."""
    lane = lanes_in(roads)[0]
    near, far, inside = (before(roads, lane, gap) for gap in (0.3, 0.55, -0.1))

    def found(between: tuple[float, ...], **rules: float) -> list[tuple[object, ...]]:
        places = [near] * 8 + [far] * 4 + [near] * 8 + [between] * 4 + [near] * 8
        found = said(judged(case(roads, 2, exit_time=99.0, **rules), pair(roads, 1, places)))
        return [entry for entry in found if entry[0] == "E3.tickets"]

    assert found(far) == [("E3.tickets", 1, 29, 5)]
    assert found(far, tickets=2) == []
    assert found(inside) == []


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
        others[1] = after(roads, lanes_out(roads)[1], gap - RHO, lateral)
        script = hold(others[0], inside, *others[1:], frames=31)
        return [
            entry for entry in said(judged(case(roads, len(others) + 1, exit_time=3.0), script)) if entry[0] != "2.left"
        ]

    late = [("E4", 1, 30, 0)]
    for grain, expected in ((0.0, []), (EPS, late)):
        assert found(0.8 - EPS) == []
        assert found(0.8 + EASED + grain) == expected
        assert found(0.5, BESIDE + EASED + grain) == expected
        assert found(0.5, -0.6 - BESIDE - EASED - grain) == expected


@both
def test_e4_who_is_out_on_a_lane_that_an_obstacle_narrows_has_the_other_exits(roads: RoadNetwork) -> None:
    """The body meets the disc, and its centre is just out of it; a car takes each other exit, or is far from it."""
    out = lanes_out(roads)

    def found(gap: float, lateral: float) -> list[tuple[object, ...]]:
        trial = case(roads, len(out) + 1, exit_time=3.0)
        x, y, _, _ = on_lane(roads, out[0], 1.6, lateral)
        problem = replace(trial.problem, obstacles=(DiscObstacle(x, y, 0.1),))
        own, taken = on_lane(roads, out[0], 1.1, -0.3), [after(roads, lane, gap) for lane in out[1:]]
        script = hold(away(roads), own, *taken, frames=31)
        return [entry for entry in said(judged(replace(trial, problem=problem), script)) if entry[:2] == ("E4", 1)]

    late = [("E4", 1, 30, 0)]
    assert (found(1.2, -0.3), found(0.4, -0.3)) == (late, [])
    assert (found(1.2, -0.8), found(0.4, -0.8)) == (late, late)


@both
def test_e4_a_free_exit_has_room_for_a_whole_body(roads: RoadNetwork) -> None:
    """Rectangles of 0.6 m: no other centre within 3 rho + 0.2 m of the disc, no obstacle within 2 rho + 0.2 m."""
    box, out = Car(body=Rectangle(0.6, 0.28)), lanes_out(roads)
    rho = box.body.reach
    inside = on_lane(roads, out[0], 0.1, -0.1)

    def found(gap: float, obstacle: float | None = None) -> list[tuple[object, ...]]:
        others = [after(roads, lane, 0.4) for lane in out]
        others[1] = after(roads, out[1], gap - RHO)
        trial = case(roads, len(others) + 1, exit_time=3.0)
        x, y, _, _ = on_lane(roads, out[1], 1.05 + (obstacle or 9.0), -0.3)
        problem = replace(trial.problem, car=box, obstacles=(DiscObstacle(x, y, 0.05),))
        script = hold(others[0], inside, *others[1:], frames=31)
        return [entry for entry in said(judged(replace(trial, problem=problem), script)) if entry[0] == "E4"]

    late = [("E4", 1, 30, 0)]
    assert found(3.0 * rho + 0.2 - EPS) == []
    assert found(3.0 * rho + 0.2 + EPS) == late
    assert found(1.5, 2.0 * rho + 0.2 - EPS) == []
    assert found(1.5, 2.0 * rho + 0.2 + EPS) == late


@both
def test_e4_who_comes_toward_the_disc_takes_an_exit_only_by_narrowing_it(roads: RoadNetwork) -> None:
    """Rectangles of 0.26 m that turn slowly leave room for another one where their centres are just in the lane."""
    box, out = Car(body=Rectangle(0.5, 0.26), bounds=Bounds(yaw_rate=0.1)), lanes_out(roads)
    inside = on_lane(roads, out[0], 0.1, -0.1)

    def found(aside: float, *, comes: bool) -> list[tuple[object, ...]]:
        others = [after(roads, lane, 0.4) for lane in out]
        x, y, c, s = after(roads, out[1], 0.3, aside)
        others[1] = (x, y, -c, -s) if comes else (x, y, c, s)
        trial = case(roads, len(others) + 1, exit_time=3.0, rest_time=99.0)
        script = hold(others[0], inside, *others[1:], frames=31)
        boxed = replace(trial, problem=replace(trial.problem, car=box))
        return [entry for entry in said(judged(boxed, script)) if entry[0] == "E4"]

    late, room = [("E4", 1, 30, 0)], 0.6 - 0.13 - 0.36
    for comes in (False, True):
        assert found(-room - EPS, comes=comes) == []
        assert found(EPS, comes=comes) == late
    assert found(-room + EPS, comes=True) == late
    assert found(-room + EPS, comes=False) == []


@both
def test_e4_seconds_do_not_count_in_which_the_ego_has_come_into_the_disc(roads: RoadNetwork) -> None:
    """The ego, that came later, is there from frame 20 to 40, or later again, or from the same frame on."""
    out, enters = lanes_out(roads)[1], lanes_in(roads)[0]
    inside, away_, there = (
        on_lane(roads, out, 0.6, -0.3),
        before(roads, enters, 0.3),
        before(roads, enters, -0.3),
    )

    def found(ego: range, agent: int = 0, **rules: float) -> list[tuple[object, ...]]:
        waits = before(roads, lanes_in(roads)[1], 0.8)
        script = [[there if k in ego else away_, inside if k >= agent else waits] for k in range(120)]
        return [entry for entry in said(judged(case(roads, 2, **rules), script)) if entry[0] == "E4"]

    assert found(range(0)) == [("E4", 1, 50, 0)]
    assert found(range(20, 40)) == [("E4", 1, 70, 0)]
    assert found(range(20, 120)) == []
    assert found(range(10), agent=20) == [("E4", 1, 70, 20)]
    assert found(range(15, 120), agent=20) == [("E4", 1, 70, 20)]
    assert found(range(20, 120), agent=20) == []
    assert found(range(20, 120), agent=20, shared_time=3.0) == [("E4", 1, 100, 20)]
    assert found(range(20, 30), agent=20) == [("E4", 1, 79, 20)]
    assert found(range(20, 120), shared_time=3.0) == [("E4", 1, 81, 0)]
    assert found(range(30, 120), agent=20, shared_time=3.0) == [("E4", 1, 101, 20)]


@both
def test_e4_seconds_count_once_the_centre_has_been_out_of_the_disc(roads: RoadNetwork) -> None:
    """The ego comes at frame 20; the agent's centre is out of the disc never, from the start, or in one frame."""
    out, enters = lanes_out(roads)[1], lanes_in(roads)[0]
    far, there = before(roads, enters, 0.3), before(roads, enters, -0.3)
    inside, beyond, coming = (
        on_lane(roads, out, 0.6, -0.3),
        after(roads, out, -EPS),
        before(roads, out ^ 1, -EPS),
    )

    def found(agent: dict[int, tuple[float, ...]]) -> list[tuple[object, ...]]:
        script = [[there if k >= 20 else far, agent.get(k, inside)] for k in range(80)]
        return [entry for entry in said(judged(case(roads, 2), script)) if entry[0] == "E4"]

    assert found({}) == []
    assert found(dict.fromkeys(range(80), beyond)) == [("E4", 1, 50, 0)]
    assert found({40: beyond}) == [("E4", 1, 70, 0)]
    assert found({0: coming}) == []


@both
def test_e4_who_is_out_on_a_lane_has_no_other_exit(roads: RoadNetwork) -> None:
    """The agent's centre is beyond the disc; somebody stands before it on its lane, and all other exits are free."""
    out = lanes_out(roads)[1]

    def found(ahead: float, centre: float) -> list[tuple[object, ...]]:
        script = hold(after(roads, out, ahead), on_lane(roads, out, centre, -0.3), frames=60)
        return [entry for entry in said(judged(case(roads, 2), script)) if entry[0] == "E4"]

    beyond = math.sqrt(1.0 - 0.09)
    assert found(0.4, beyond + EPS) == []
    assert found(0.7, beyond + EPS) == [("E4", 1, 50, 0)]
    assert found(0.4, beyond - EPS) == [("E4", 1, 50, 0)]


@both
def test_e4_the_way_back_is_no_exit_of_a_bend(roads: RoadNetwork) -> None:
    """A car stands behind the bend's disc; the agent came by the other segment, or began in the disc."""
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    back, out = roads.arms(v)
    came, inside = before(roads, back ^ 1, 0.3), before(roads, back ^ 1, -0.3)
    parked = after(roads, out, 0.4)

    def found(*places: tuple[float, ...], last: tuple[float, ...] = parked) -> list[tuple[object, ...]]:
        script = [[away(roads), place, last] for place in (*places, *[inside] * 60)]
        return [entry for entry in said(judged(case(roads, 3), script)) if entry[0] == "E4" and entry[1] == 1]

    assert found(came) == []
    assert found() == [("E4", 1, 50, 0)]
    assert found(came, last=after(roads, out, 0.8)) == [("E4", 1, 51, 1)]
    assert found(came, last=after(roads, out, 0.4, 0.3)) == [("E4", 1, 51, 1)]


@both
def test_e4_in_a_bend_who_comes_the_other_way_closes_no_exit(roads: RoadNetwork) -> None:
    """Two are in a bend, each nearer to the way by which the other came; or both came by one segment, or began there.

    The ego, in the disc before the agent, is in its way whence ever it came.
    """
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)

    def found(*places: tuple[tuple[float, ...], ...]) -> list[tuple[object, ...]]:
        """Each car is for a frame at each of its places, and stays at the last."""
        script = [[own[min(k, len(own) - 1)] for own in places] for k in range(60)]
        return [entry for entry in said(judged(case(roads, len(places)), script)) if entry[0] == "E4"]

    by_one, by_two = (before(roads, lane ^ 1, 0.3) for lane in (one, two))
    at_one, at_two = (on_lane(roads, lane, 0.7, -0.3) for lane in (one, two))
    gone, passes = (away(roads),), on_lane(roads, two, 0.7, 0.3)
    assert found(gone, (by_one, at_one), (by_two, at_two)) == [("E4", 1, 51, 1), ("E4", 2, 51, 1)]
    assert found((by_two, at_two), (by_one, by_one, at_one)) == []
    assert found((at_two,), (by_one, at_one)) == []
    assert found((by_two, at_one), (by_one, by_one, at_two)) == [("E4", 1, 52, 2)]
    assert found(gone, (by_one, at_one), (by_one, at_two)) == [("E4", 2, 51, 1)]
    assert found(gone, (by_one, at_one), (at_two,)) == [("E4", 2, 50, 0)]
    assert found(gone, (passes,), (by_two, at_two)) == [("E4", 1, 50, 0), ("E4", 2, 51, 1)]


def test_e4_in_a_dead_end_who_is_nearer_to_the_way_out_leaves_first() -> None:
    out = STAR.arms(STAR.vertex((0, 1)))[0]
    deep, near = on_lane(STAR, out, 0.1, -0.3), on_lane(STAR, out, 0.6, -0.3)
    far = on_lane(STAR, lanes_star(), 2.0, -0.3)
    assert said(judged(case(STAR, 3, rest_time=600.0), hold(far, deep, near, frames=51))) == [("E4", 2, 50, 0)]
    assert said(judged(case(STAR, 2), hold(near, deep, frames=51))) == []


def lanes_star() -> int:
    return STAR.arms(STAR.vertex((2, 1)))[0]


def test_e4_from_disc_to_disc_the_time_begins_anew() -> None:
    roads = RoadNetwork(((0, 0, 1, 0),), 3.0, (0.0, 0.0, 0.0), (1, 2))
    places = [on_lane(roads, 0, 0.5, -0.3)] * 30 + [on_lane(roads, 0, 2.5, -0.3)] * 30
    assert said(judged(case(roads, 2), [[on_lane(roads, 1, 1.5, -0.3), place] for place in places])) == []


# E5


SOON = {"rest_time": 3.0, "journey_lengths": 0.0, "journey_start_time": 0.0}
"""A journey has three seconds that count."""


@both
def test_e5_a_journey_has_a_minute_and_the_time_for_its_way(roads: RoadNetwork) -> None:
    place = on_lane(roads, lanes_out(roads)[1], 2.2, -0.3)

    def found(frames: int, **rules: float) -> list[tuple[object, ...]]:
        return said(judged(case(roads, 2, **rules), pair(roads, 1, [place] * frames)))

    whole = 600 + math.ceil(10.0 * 4.0 * float(roads.lengths.max()) / 0.7)
    assert found(whole) == []
    assert found(whole + 1) == [("E5", 1, whole, 0)]
    assert found(600, journey_lengths=0.0) == []
    assert found(700, journey_lengths=0.0) == [("E5", 1, 600, 0)]


@both
def test_e5_who_goes_to_and_fro_over_the_edge_of_a_disc_begins_no_journey(roads: RoadNetwork) -> None:
    """It is in the disc of the bend, and outside, for a second each: time counts in both; another disc ends that."""
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)
    places = [after(roads, two, 0.15 if k // 10 % 2 else -0.1) for k in range(40)]
    rules = {**SOON, "exit_time": 99.0}
    assert said(judged(case(roads, 2, **rules), pair(roads, 1, places))) == [("E5", 1, 30, 0)]
    elsewhere = [*places[:25], after(roads, one ^ 1, -0.1), *places[:25]]
    assert roads.lane_ends(one ^ 1)[0] != v
    found = [entry for entry in said(judged(case(roads, 2, **rules), pair(roads, 1, elsewhere))) if entry[0] == "E5"]
    assert found == []


@both
def test_e5_the_start_of_a_journey_counts_whatever_is_ahead(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]
    script = hold(on_lane(roads, lane, 2.4, -0.3), on_lane(roads, lane, 1.2, -0.3), frames=60)
    assert said(judged(case(roads, 2, **{**SOON, "journey_start_time": 2.0}), script)) == []
    assert said(judged(case(roads, 2, **{**SOON, "journey_start_time": 3.0}), script)) == [("E5", 1, 30, 0)]


@both
def test_e5_the_way_is_free_beyond_a_metre_and_a_half(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]

    def found(ahead: float) -> list[tuple[object, ...]]:
        script = hold(on_lane(roads, lane, 1.2 + ahead, -0.3), on_lane(roads, lane, 1.2, -0.3), frames=31)
        return said(judged(case(roads, 2, **SOON), script))

    assert found(1.5 - EPS) == []
    assert found(1.5 + EASED) == []
    assert found(1.5 + EPS) == [("E5", 1, 30, 0)]


@both
def test_e5_of_two_that_meet_time_counts_for_who_is_on_the_left(roads: RoadNetwork) -> None:
    """The agents 1 and 2 face each other in the lane of 2; unless the ego is near, 1 has to go back."""
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])
    over, meets = on_lane(roads, lane, 1.6, 0.25), on_lane(roads, lane ^ 1, length - 2.6, -0.3)

    def found(ego: tuple[float, ...]) -> list[tuple[object, ...]]:
        script = [[ego, over, meets] for _ in range(40)]
        return [entry for entry in said(judged(case(roads, 3, **SOON), script)) if entry[0] == "E5"]

    assert found(on_lane(roads, lanes_in(roads)[1], 1.2, -0.3)) == [("E5", 1, 30, 0)]
    hems = 2.0 * RHO + 0.8
    assert found(on_lane(roads, lane, 1.6 - hems + EPS, 0.25)) == []
    assert found(on_lane(roads, lane, 1.6 - hems - EPS, 0.25)) == [("E5", 1, 30, 0)]


@both
def test_e5_the_ego_near_who_is_left_excuses_for_a_while(roads: RoadNetwork) -> None:
    """The ego is beside agent 1, in the same lane state or in the other one, or left as well."""
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])
    over, meets = on_lane(roads, lane, 1.6, 0.25), on_lane(roads, lane ^ 1, length - 2.6, -0.3)

    def found(ego: tuple[float, ...], frames: int) -> list[tuple[object, ...]]:
        script = [[ego, over, meets] for _ in range(frames)]
        return [entry for entry in said(judged(case(roads, 3, **SOON), script)) if entry[:2] == ("E5", 1)]

    behind, comes = on_lane(roads, lane, 1.2, -0.3), on_lane(roads, lane ^ 1, length - 1.2, 0.3)
    for ego in (behind, comes, on_lane(roads, lane, 1.2, -0.1)):
        assert found(ego, 60) == []
        assert found(ego, 61) == [("E5", 1, 60, 0)]


def test_e5_an_obstacle_excuses_who_may_lack_room_to_pass_it() -> None:
    """An obstacle is 0.8 m ahead of the agent; others are on the road, in the disc ahead, or behind."""
    roads = GRID
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])

    def found(
        ego: tuple[float, ...],
        *more: tuple[float, float],
        far: float = 2.4,
        at: float = 1.6,
        follows: float | None = None,
        body: Body | None = None,
        **rules: float,
    ) -> list[tuple[object, ...]]:
        trial = case(roads, 2, **{**SOON, **rules})
        places = [on_lane(roads, lane, *place)[:2] for place in ((far, -0.3), *more)]
        obstacles = tuple(DiscObstacle(x, y, 0.1) for x, y in places)
        car = replace(trial.problem.car, body=body or trial.problem.car.body)
        problem = replace(trial.problem, obstacles=obstacles, car=car)
        script = hold(ego, on_lane(roads, lane, at, -0.3), frames=31 if follows is None else 41)
        if follows is not None:
            for k, frame in enumerate(script):
                frame[0] = on_lane(roads, lane, 1.25 + 0.1 * k * follows, -0.3)
        told = said(judged(replace(trial, problem=problem), script))
        assert set(told) == Judge(replace(trial, problem=problem), script).breaches()
        return told

    elsewhere = on_lane(roads, lanes_in(roads)[1], 1.6, -0.3)
    late = [("E5", 1, 30, 0)]
    assert found(elsewhere) == late
    assert found(on_lane(roads, lane, 1.2 - EPS, -0.3), at=2.7, far=2.74) == late
    assert found(on_lane(roads, lane, 1.2 + EPS, -0.3), at=2.7, far=2.74) == []
    assert found(elsewhere, at=2.7, far=2.74, follows=0.04) == [("E5", 1, 39, 0)]
    assert found(elsewhere, at=2.7, far=2.74, follows=0.06) == []
    assert found(on_lane(roads, lane, 1.4, 0.3)) == []
    assert found(on_lane(roads, lane, 2.6, -0.3)) == []
    assert found(on_lane(roads, lane ^ 1, length - 0.9, -0.3)) == []
    assert found(on_lane(roads, lane, length - 0.5, -0.3)) == []
    assert found(elsewhere, (4.0, 0.3)) == []
    assert found(elsewhere, (4.75, 0.3)) == late
    narrow = {"way_distance": length, "blocked_ahead": 1.5}
    for long, body in ((0.0, Disc(RHO)), (0.4, Rectangle(0.4, 0.25))):
        by_the_disc = length - 1.0 - long - 0.85 * 0.8
        assert found(elsewhere, far=by_the_disc - 0.1 - EPS, body=body, **narrow) == late
        assert found(elsewhere, far=by_the_disc - 0.1 + EPS, body=body, **narrow) == []


@both
def test_e5_a_bend_is_no_free_way_that_is_full_or_has_the_ego_in_it(roads: RoadNetwork) -> None:
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)
    waits = before(roads, one ^ 1, 0.4)
    rules = {**SOON, "rest_time": 1.0, "exit_time": 99.0}

    def found(
        ego: tuple[float, ...],
        other: tuple[float, ...],
        *,
        frames: int = 20,
        goal: bool = False,
        **more: float,
    ) -> list[tuple[object, ...]]:
        goals = [roads.intersections[v]] if goal else []
        script = hold(ego, waits, other, frames=frames)
        found = said(judged(case(roads, 3, goals, **{**rules, **more}), script))
        return [entry for entry in found if entry[:2] == ("E5", 1)]

    late = [("E5", 1, 10, 0)]
    far, beyond = away(roads), after(roads, two, 1.0)
    assert found(far, beyond) == late
    assert found(far, after(roads, two, 0.3)) == []
    assert found(far, after(roads, two, 0.3), frames=22) == [("E5", 1, 20, 0)]
    assert found(far, after(roads, two, 0.3), frames=22, goal=True) == []
    assert found(far, after(roads, two, 0.3, 0.3)) == late
    assert found(after(roads, two, -EPS), beyond) == []
    assert found(after(roads, two, -EPS), beyond, way_distance=0.3, blocked_ahead=0.3) == late
    assert found(far, after(roads, two, -EPS, 0.3)) == late


@both
def test_e5_who_comes_the_other_way_through_a_bend_closes_no_exit(roads: RoadNetwork) -> None:
    """The other is nearer to the agent's exit, having come by it, or having begun there."""
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)
    waits, by_two, at_two = (
        before(roads, one ^ 1, 0.4),
        before(roads, two ^ 1, 0.3),
        on_lane(roads, two, 0.7, -0.3),
    )
    rules = {**SOON, "rest_time": 1.0, "exit_time": 99.0}

    def found(start: tuple[float, ...]) -> list[tuple[object, ...]]:
        script = [[away(roads), waits, start if k == 0 else at_two] for k in range(20)]
        return [entry for entry in said(judged(case(roads, 3, **rules), script)) if entry[:2] == ("E5", 1)]

    assert found(by_two) == [("E5", 1, 10, 0)]
    assert found(at_two) == []


@both
def test_e5_one_of_the_same_lane_in_the_bend_has_to_leave_it_first(roads: RoadNetwork) -> None:
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)
    waits = before(roads, one ^ 1, 0.9)
    rules = {**SOON, "rest_time": 1.0, "exit_time": 99.0}

    def found(came: int) -> list[tuple[object, ...]]:
        inside = after(roads, two, -EPS, 0.3)
        script = [[away(roads), waits, place] for place in (before(roads, came ^ 1, 0.1), *[inside] * 22)]
        found = said(judged(case(roads, 3, **rules), script))
        return [entry for entry in found if entry[:2] == ("E5", 1)]

    assert found(one) == []
    assert found(two) == [("E5", 1, 10, 0)]


@both
def test_e5_a_queue_is_no_free_way(roads: RoadNetwork) -> None:
    lane = lanes_in(roads)[0]
    length = float(roads.lengths[lane // 2])
    waits = on_lane(roads, lane, length - 1.6, -0.3)
    behind = on_lane(roads, lane, length - 2.9, -0.3)
    inside = after(roads, lanes_out(roads)[1], -0.5)
    script = [[inside, waits, behind] for _ in range(80)]
    assert said(judged(case(roads, 3, **SOON), script)) == []


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


@both
def test_e6_time_does_not_count_in_which_the_ego_is_at_the_last_exit(roads: RoadNetwork) -> None:
    """A dead end, or a bend one of whose exits is the way by which the agent came."""
    v, inside, came = way_out(roads)
    out = roads.arms(v)[0]

    def found(gap: float, stays: int, **rules: float) -> list[tuple[object, ...]]:
        ego = after(roads, out, gap - RHO)
        script = [[ego if 10 <= k < 10 + stays else away(roads), inside if k else came] for k in range(90)]
        problem = case(roads, 2, [roads.intersections[v]], goal_time=3.0, exit_time=99.0, **rules)
        return [entry for entry in said(judged(problem, script)) if entry[0] == "E6"]

    assert found(0.8 - EPS, 0) == [("E6", 1, 31, 1)]
    assert found(0.8 - EPS, 15) == [("E6", 1, 46, 1)]
    assert found(0.8 - EPS, 80) == []
    assert found(0.8 + EASED, 15) == [("E6", 1, 46, 1)]
    assert found(0.8 + 2 * EPS, 15) == [("E6", 1, 31, 1)]


@both
def test_e6_time_does_not_count_while_the_ego_is_at_the_mouth_of_a_taken_exit(roads: RoadNetwork) -> None:
    """A car takes the exit of a dead end or bend; the ego is beside it, in the other lane, or far away."""
    v, inside, came = way_out(roads)
    out = roads.arms(v)[0]
    takes, beside = after(roads, out, 0.3), after(roads, out, 0.1, 0.3)

    def found(ego: tuple[float, ...], **rules: float) -> list[tuple[object, ...]]:
        script = [[ego, inside if k else came, takes] for k in range(40)]
        problem = case(roads, 3, [roads.intersections[v]], goal_time=3.0, exit_time=99.0, **rules)
        return [entry for entry in said(judged(problem, script)) if entry[0] == "E6"]

    assert found(beside) == []
    assert found(beside, goal_gap=0.3) == [("E6", 1, 31, 1)]
    assert found(away(roads)) == [("E6", 1, 31, 1)]


@both
def test_e6_time_does_not_count_while_a_queue_from_the_ego_takes_the_exit(roads: RoadNetwork) -> None:
    """The car that takes the exit is behind the ego, or behind one that is behind the ego, within 1.5 m each."""
    v, inside, came = way_out(roads)
    out = roads.arms(v)[0]
    takes = after(roads, out, 0.3)
    begins = math.sqrt((1.3 + RHO) ** 2 - 0.09)

    def found(*ahead: float) -> list[tuple[object, ...]]:
        line = [on_lane(roads, out, begins + gap, -0.3) for gap in ahead]
        script = [[line[0], inside if k else came, takes, *line[1:]] for k in range(40)]
        problem = case(roads, len(script[0]), [roads.intersections[v]], goal_time=3.0, exit_time=99.0)
        return [entry for entry in said(judged(problem, script)) if entry[0] == "E6"]

    assert found(1.5 - EPS) == []
    assert found(1.5 + EPS) == [("E6", 1, 31, 1)]
    assert found(1.5 + EPS, 0.7) == []
    assert found(0.6, 1.2) == []


def way_out(roads: RoadNetwork) -> tuple[int, tuple[float, ...], tuple[float, ...]]:
    """Return a dead end, or a bend, a place in it, and one before it from which there is but one exit."""
    v = next((v for v, degree in enumerate(roads.degrees) if degree == 1), None)
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2) if v is None else v
    out, back = roads.arms(v)[0], roads.arms(v)[-1]
    return v, on_lane(roads, out, 0.2, 0.0), before(roads, back ^ 1, 0.1)


@both
def test_e6_time_counts_while_only_who_comes_the_other_way_is_nearer_to_an_exit(roads: RoadNetwork) -> None:
    """Two are at a goal in a bend, each nearer to the other's exit, and the ego beside one; or one and the ego."""
    v = next(v for v, degree in enumerate(roads.degrees) if degree == 2)
    one, two = roads.arms(v)
    by_one, by_two = (before(roads, lane ^ 1, 0.1) for lane in (one, two))
    at_one, at_two = (on_lane(roads, lane, 0.7, -0.3) for lane in (one, two))

    def found(ego: tuple[float, ...], other: tuple[float, ...]) -> list[tuple[object, ...]]:
        script = [[ego, *((by_one, by_two) if k == 0 else (at_one, other))] for k in range(60)]
        problem = case(roads, 3, [roads.intersections[v]], goal_time=3.0, exit_time=99.0)
        return [entry for entry in said(judged(problem, script)) if entry[0] == "E6"]

    assert found(after(roads, two, 0.3, 0.3), at_two) == [("E6", 1, 31, 1)]
    assert found(at_two, away(roads)) == []


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
    assert [entry for entry in said(judged(case(STAR, 3, [goal], goal_time=3.0), gap)) if entry[0] == "E6"] == []
