"""Each tolerance of the propositions from both sides, on a cross in line with the axes and one that is turned."""

from __future__ import annotations

import math

import numpy as np
import pytest

from dubins_traffic.cars.body import Car, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import State
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.labeller import Labeller
from tests.rules_scripts import STAR, TURNED_STAR, Frame, fill, flags, instance, label, on_lane

RHO = 0.177
REACH = 1.0 + RHO
WEST, SOUTH, EAST, NORTH = 0, 2, 5, 6
"""Lanes into the crossing of the cross, by the arm they come from."""
OUT_WEST, OUT_EAST, OUT_NORTH = 1, 4, 7
CROSSING = STAR.vertex((1, 1))
EPS = 1e-6

both = pytest.mark.parametrize("roads", [STAR, TURNED_STAR], ids=["axes", "turned"])


def lateral_stop(gap: float) -> float:
    """Return the progress on a lane 4 m long at which a disc at lateral -0.3 is `gap` from the disc ahead."""
    return 4.0 - math.sqrt((REACH + gap) ** 2 - 0.3**2)


def hold(*cars: tuple[float, ...], frames: int) -> list[Frame]:
    """Return a script in which nobody moves."""
    return [list(cars) for _ in range(frames)]


def far(roads: RoadNetwork) -> tuple[float, ...]:
    """Return the pose of a car that is in nobody's way."""
    return on_lane(roads, OUT_EAST, 2.0, -0.3)


@both
def test_on_road_ends_at_half_a_road(roads: RoadNetwork) -> None:
    inside, outside = (on_lane(roads, WEST, 2.0, -0.6 + step) for step in (EPS, -EPS))
    found = label([instance(roads, 2)], [hold(inside, outside, frames=1)])
    assert ["on_road" in flags(found, n)[0] for n in (0, 1)] == [True, False]


@both
def test_at_and_cross_end_at_the_disc(roads: RoadNetwork) -> None:
    places = [on_lane(roads, WEST, 4.0 - distance, 0.0) for distance in (1 - EPS, 1 + EPS, REACH - EPS, REACH + EPS)]
    labels = label([instance(roads, 4)], [hold(*places, frames=1)])[0]
    assert labels.at[0].tolist() == [CROSSING, -1, -1, -1]
    assert labels.crosses[0].tolist() == [CROSSING, CROSSING, CROSSING, -1]


@both
def test_a_rectangle_crosses_with_its_corner(roads: RoadNetwork) -> None:
    car = Car(body=Rectangle(0.6, 0.2))
    places = [on_lane(roads, WEST, 4.0 - distance, 0.0) for distance in (1.3 - EPS, 1.3 + EPS)]
    labels = label([instance(roads, 2, car=car)], [hold(*places, frames=1)])[0]
    assert labels.crosses[0].tolist() == [CROSSING, -1]


@both
def test_lane_state_at_the_start_follows_the_heading(roads: RoadNetwork) -> None:
    ahead, back = on_lane(roads, WEST, 2.0, 0.1), on_lane(roads, WEST, 2.0, 0.1, back=True)
    inside = on_lane(roads, WEST, 3.5, 0.0)
    labels = label([instance(roads, 3)], [hold(ahead, back, inside, frames=1)])[0]
    assert labels.lane[0].tolist() == [WEST, OUT_WEST, -1]


@both
def test_leaving_a_disc_sets_the_lane_away_from_it_whatever_the_heading(roads: RoadNetwork) -> None:
    script = [[on_lane(roads, OUT_NORTH, s, 0.1, back=True)] for s in (0.9, 0.99, 1.01, 1.2)]
    lanes = [int(labels.lane[0, 0]) for labels in label([instance(roads, 1)], [script])]
    assert lanes == [-1, -1, OUT_NORTH, OUT_NORTH]


@both
@pytest.mark.parametrize(("back", "lane"), [(0.3 - EPS, WEST), (0.3 + EPS, OUT_WEST)])
def test_backing_up_flips_the_lane_state(roads: RoadNetwork, back: float, lane: int) -> None:
    script = [[on_lane(roads, WEST, s, -0.3)] for s in (2.0, 2.2, 2.1, 2.2 - back)]
    found = label([instance(roads, 1)], [script])
    assert int(found[-1].lane[0, 0]) == lane
    assert ("turned" in flags(found, 0)[-1]) == (lane == OUT_WEST)


def test_a_car_that_strays_onto_another_road_gets_its_lane_by_heading() -> None:
    roads = RoadNetwork.grid(2, 2, 4.0)
    first, other = 0, 2
    script = [[on_lane(roads, 2 * first, 2.0, lateral)] for lateral in (-0.3, 0.59, 0.7, 2.0, 3.3)]
    script += [[on_lane(roads, 2 * other, 2.0, -0.3)], [on_lane(roads, 2 * first, 2.0, 0.61)]]
    lanes = [int(labels.lane[0, 0]) // 2 for labels in label([instance(roads, 1)], [script])]
    assert lanes[:4] == [first] * 4
    assert lanes[5:] == [other] * 2


@both
def test_left_rises_and_falls_apart(roads: RoadNetwork) -> None:
    reach = (-0.2, 0.05 - EPS, 0.05 + EPS, EPS, -EPS, 0.05 - EPS)
    script = [[on_lane(roads, WEST, 2.0, lateral - RHO)] for lateral in reach]
    left = ["left" in found for found in flags(label([instance(roads, 1)], [script]), 0)]
    assert left == [False, False, True, True, False, False]


@both
def test_still_needs_the_whole_time_and_little_way(roads: RoadNetwork) -> None:
    def seen(way: float, frames: int) -> bool:
        script = [[on_lane(roads, WEST, 1.5, -0.3)]] + [
            [on_lane(roads, WEST, 1.5 + way, -0.3)] for _ in range(frames - 1)
        ]
        return "still" in flags(label([instance(roads, 1)], [script]), 0)[-1]

    assert not seen(0.0, 10)
    assert seen(0.0, 11)
    assert seen(0.05 - EPS, 11)
    assert not seen(0.05 + EPS, 11)


@both
def test_who_has_not_come_half_a_metre_farther_in_ten_seconds_lingers(roads: RoadNetwork) -> None:
    def seen(way: float, frames: int, back: float = 0.0) -> list[bool]:
        script = [
            [on_lane(roads, WEST, 1.3 + way * min(k, 100) / 100 - (back if k % 2 else 0.0), -0.3)]
            for k in range(frames)
        ]
        return ["lingers" in found for found in flags(label([instance(roads, 1)], [script]), 0)]

    assert seen(0.0, 102) == [False] * 100 + [True] * 2
    for back in (0.0, 0.25):
        assert seen(0.5 - EPS, 101, back)[-1]
        assert not seen(0.5 + EPS, 101, back)[-1]
        assert seen(0.5 + EPS, 103, back)[-1]


@both
def test_lingering_begins_anew_with_the_lane_state(roads: RoadNetwork) -> None:
    """In a disc nobody lingers; and who turns round begins anew, though it makes no way."""
    script = [[on_lane(roads, WEST, 2.0 - (0.31 if k >= 60 else 0.0), -0.3)] for k in range(170)]
    assert [k for k, found in enumerate(flags(label([instance(roads, 1)], [script]), 0)) if "lingers" in found] == [
        *range(160, 170)
    ]
    inside = [[on_lane(roads, WEST, 0.5, -0.3)] for _ in range(120)]
    assert not any("lingers" in found for found in flags(label([instance(roads, 1)], [inside]), 0))


@both
def test_who_lingers_stands_unless_it_waits_in_a_queue(roads: RoadNetwork) -> None:
    """It swings by 0.1 m, so that it is never still; what swings blocks who is behind it."""
    swings = [on_lane(roads, WEST, 2.0 - 0.1 * (k % 4 < 2), -0.3) for k in range(120)]
    behind = [on_lane(roads, WEST, 1.2, -0.3)] * 120
    found = label([instance(roads, 2)], [[list(cars) for cars in zip(swings, behind, strict=True)]])
    assert [{"stands", "lingers"} <= own for own in flags(found, 0)] == [k >= 100 for k in range(120)]
    assert ["blocked" in own for own in flags(found, 1)] == [k >= 100 for k in range(120)]


@both
def test_a_new_stop_in_one_wait_is_a_new_ticket(roads: RoadNetwork) -> None:
    for between, forfeited in ((0.52, True), (-0.02, False)):
        gaps = [0.25] * 8 + [between] * 4 + [0.25] * 8
        script = [[on_lane(roads, WEST, lateral_stop(gap), -0.3)] for gap in gaps]
        last = flags(label([instance(roads, 1)], [script]), 0)[-1]
        assert ("forfeited" in last, "stopped" in last) == (forfeited, True)


@both
def test_approach_is_within_half_a_metre_and_foremost(roads: RoadNetwork) -> None:
    near, beyond = (on_lane(roads, WEST, lateral_stop(0.5 + step), -0.3) for step in (-EPS, EPS))
    behind = on_lane(roads, SOUTH, lateral_stop(0.4), -0.3)
    before = on_lane(roads, SOUTH, lateral_stop(0.1), -0.3)
    entering = on_lane(roads, NORTH, lateral_stop(-EPS), -0.3)
    follows = on_lane(roads, NORTH, lateral_stop(0.3), -0.3)
    found = label([instance(roads, 6)], [hold(near, beyond, behind, before, entering, follows, frames=1)])
    approach = ["approach" in flags(found, n)[0] for n in range(6)]
    assert approach == [True, False, False, True, False, True]


@both
def test_stopped_takes_the_time_and_is_kept_until_the_car_backs_off(roads: RoadNetwork) -> None:
    stop = lateral_stop(0.3)
    script = [[on_lane(roads, WEST, stop, -0.3)] for _ in range(8)]
    script += [[on_lane(roads, WEST, lateral_stop(gap), -0.3)] for gap in (0.3, 0.5 - EPS, 0.5 + EPS, 0.3)]
    stopped = ["stopped" in found for found in flags(label([instance(roads, 1)], [script]), 0)]
    assert stopped == [False] * 5 + [True] * 5 + [False] * 2


def arrivals(roads: RoadNetwork, *cars: tuple[int, int], frames: int, rate: float = 10.0) -> list[set[str]]:
    """Return the last flags of cars that come to stand on a lane at a frame, after a distant start."""
    script: list[Frame] = []
    for k in range(frames):
        frame: Frame = []
        for lane, begin in cars:
            s = lateral_stop(0.3) if k >= begin else 1.5 + 0.08 * (k % 2)
            frame.append(on_lane(roads, lane, s, -0.3))
        script.append(frame)
    found = label([instance(roads, len(cars), rate=rate)], [script])
    return [flags(found, n)[-1] for n in range(len(cars))]


def first_of(found: list[set[str]]) -> list[int]:
    """Return which cars are first in order."""
    assert all(("ahead" in flag) != ("first" in flag) for flag in found if "stopped" in flag)
    return [n for n, flag in enumerate(found) if "first" in flag]


@both
def test_the_earlier_ticket_goes_first_unless_they_are_a_group(roads: RoadNetwork) -> None:
    assert first_of(arrivals(roads, (SOUTH, 4), (WEST, 2), frames=12)) == [1]
    assert first_of(arrivals(roads, (WEST, 3), (SOUTH, 4), frames=12)) == [1]
    assert first_of(arrivals(roads, (WEST, 2), (SOUTH, 4), frames=12)) == [0]


@both
def test_the_right_goes_first(roads: RoadNetwork) -> None:
    assert first_of(arrivals(roads, (WEST, 0), (SOUTH, 0), frames=8)) == [1]
    assert first_of(arrivals(roads, (SOUTH, 0), (WEST, 0), frames=8)) == [0]
    assert first_of(arrivals(roads, (SOUTH, 0), (EAST, 0), frames=8)) == [1]
    assert first_of(arrivals(roads, (EAST, 0), (NORTH, 0), frames=8)) == [1]
    assert first_of(arrivals(roads, (NORTH, 0), (WEST, 0), frames=8)) == [1]


@both
def test_opposite_arms_and_a_full_crossing_go_by_index(roads: RoadNetwork) -> None:
    assert first_of(arrivals(roads, (NORTH, 0), (SOUTH, 0), frames=8)) == [0]
    assert first_of(arrivals(roads, (EAST, 0), (WEST, 0), frames=8)) == [0]
    assert first_of(arrivals(roads, (EAST, 0), (SOUTH, 0), (WEST, 0), (NORTH, 0), frames=8)) == [0]


def test_places_follow_groups_then_the_right() -> None:
    cars = [(WEST, 0), (SOUTH, 0), (EAST, 6), (NORTH, 0)]
    state = State.zeros(1, 4)
    labeller = Labeller([instance(STAR, 4)])
    for k in range(14):
        frame = [on_lane(STAR, lane, lateral_stop(0.3) if k >= begin else 1.5 + 0.1 * k, -0.3) for lane, begin in cars]
        fill(state, 0, frame)
        if k == 0:
            labeller.reset(state)
        else:
            labeller.update(k, state, [()])
    assert labeller.places[0].tolist() == [1, 0, 3, 2]
    assert labeller.tickets[0].tolist() == [5, 5, 11, 5]


@both
def test_a_ticket_is_forfeited_after_three_seconds_at_a_clear_crossing(roads: RoadNetwork) -> None:
    cars = ((WEST, 0), (SOUTH, 10))
    assert first_of(arrivals(roads, *cars, frames=35)) == [0]
    found = arrivals(roads, *cars, frames=36)
    assert first_of(found) == [1]
    assert ["forfeited" in flag for flag in found] == [True, False]


@both
def test_nobody_forfeits_while_the_crossing_is_taken(roads: RoadNetwork) -> None:
    waits, taken = on_lane(roads, WEST, lateral_stop(0.3), -0.3), on_lane(roads, OUT_NORTH, 0.4, -0.3)
    found = flags(label([instance(roads, 2)], [hold(waits, taken, frames=60)]), 0)
    assert "first" in found[-1]
    assert not {"forfeited", "clear"} & set().union(*found)


def crossed(roads: RoadNetwork, stop: int, gap: float = 0.3, *others: tuple[float, ...]) -> set[str]:
    """Return the flags of a car that enters after standing for `stop` frames, beside others that stand."""
    places = [lateral_stop(gap)] * stop + [lateral_stop(0.01), lateral_stop(-0.05)]
    script = [[on_lane(roads, WEST, s, -0.3), *others] for s in places]
    return flags(label([instance(roads, 1 + len(others))], [script]), 0)[-1]


@both
def test_an_entry_is_judged_on_the_frame_before(roads: RoadNetwork) -> None:
    inside = on_lane(roads, OUT_NORTH, 0.4, -0.3)
    assert {"entered", "in_crossing"} <= crossed(roads, 6)
    assert "breach3" not in crossed(roads, 6)
    assert "breach3" in crossed(roads, 5)
    assert "breach3" in crossed(roads, 6, 0.3, inside)
    assert "breach3" in crossed(roads, 6, 0.3, on_lane(roads, SOUTH, lateral_stop(0.3), -0.3))
    assert "breach3" not in crossed(roads, 6, 0.3, on_lane(roads, NORTH, lateral_stop(0.3), -0.3))


def test_rule_3_counts_only_where_it_is_asked_for_and_defined() -> None:
    script = [[on_lane(STAR, WEST, 4.0 - distance, -0.3)] for distance in (1.5, 1.1)]
    tight = RoadNetwork(STAR.segments, 2.8, STAR.transform, STAR.shape)
    close = [[on_lane(tight, WEST, 2.8 - distance, -0.3)] for distance in (1.5, 1.1)]
    assert "breach3" in flags(label([instance(STAR, 1)], [script]), 0)[-1]
    assert "breach3" not in flags(label([instance(STAR, 1, rules={})], [script]), 0)[-1]
    assert "breach3" not in flags(label([instance(tight, 1)], [close]), 0)[-1]


def test_frame_0_has_no_entries() -> None:
    found = flags(label([instance(STAR, 1)], [hold(on_lane(STAR, WEST, 3.5, 0.0), frames=3)]), 0)
    assert all("in_crossing" in flag and not {"entered", "breach3"} & flag for flag in found)


@both
def test_a_queue_excuses_who_stands_in_it(roads: RoadNetwork) -> None:
    first = lateral_stop(0.3)
    cars = [on_lane(roads, WEST, first - back, -0.3) for back in (0.0, 0.7, 1.4)]
    lone = on_lane(roads, SOUTH, lateral_stop(0.3) - 1.0 - EPS, -0.3)
    front = on_lane(roads, SOUTH, lateral_stop(0.3), -0.3)
    found = label([instance(roads, 5)], [hold(*cars, lone, front, frames=12)])
    assert ["stands" in flags(found, n)[-1] for n in range(5)] == [False, False, False, True, False]
    near = on_lane(roads, SOUTH, lateral_stop(0.3) - 1.0 + EPS, -0.3)
    found = label([instance(roads, 2)], [hold(front, near, frames=12)])
    assert "excused" in flags(found, 1)[-1]


@both
def test_a_forfeit_ends_the_excuse(roads: RoadNetwork) -> None:
    script = hold(on_lane(roads, WEST, lateral_stop(0.3), -0.3), frames=37)
    found = flags(label([instance(roads, 1)], [script]), 0)
    assert ["stands" in flag for flag in found[33:37]] == [False, False, True, True]


@both
@pytest.mark.parametrize(
    ("ahead", "lateral", "blocked"),
    [(1.5 - EPS, -0.3, True), (1.5 + EPS, -0.3, False), (-0.1, -0.3, False),
     (1.0, RHO - 0.146 + EPS, False), (1.0, RHO - 0.146 - EPS, True), (1.0, -0.6 - 0.2, False)],
)  # fmt: skip
def test_what_stands_ahead_blocks(roads: RoadNetwork, ahead: float, lateral: float, blocked: bool) -> None:
    me = on_lane(roads, OUT_WEST, 1.3, -0.3)
    thing = on_lane(roads, OUT_WEST, 1.3 + ahead, lateral)
    found = label([instance(roads, 2)], [hold(me, thing, frames=12)])
    assert ["blocked" in flag for flag in flags(found, 0)[9:]] == [False, blocked, blocked]
    obstacle = DiscObstacle(*on_lane(roads, OUT_WEST, 1.3 + ahead + RHO, lateral)[:2], RHO)
    if ahead > 0:
        found = label([instance(roads, 1, obstacles=[obstacle])], [hold(me, frames=1)])
        assert ("blocked" in flags(found, 0)[0]) == blocked


@both
@pytest.mark.parametrize(("rate", "room"), [(30.0, 0.1), (10.0, 0.07 + 0.1 * math.pi * math.hypot(0.31, 0.14) + 0.02)])
def test_room_beside_is_what_a_car_may_reach_in_a_long_tick(roads: RoadNetwork, rate: float, room: float) -> None:
    """Rule page, room beside: a rectangle needs its width and 0.1 m, or 0.02 m more than its point gets in a tick."""
    car = Car(0.3, Rectangle(0.62, 0.28))
    for free in (0.28 + room - EPS, 0.28 + room + EPS):
        obstacle = DiscObstacle(*on_lane(roads, OUT_WEST, 2.0, free - 0.6 + 0.2)[:2], 0.2)
        trial = instance(roads, 1, obstacles=[obstacle], rate=rate, car=car)
        found = label([trial], [hold(on_lane(roads, OUT_WEST, 1.3, -0.3), frames=1)])
        assert ("blocked" in flags(found, 0)[0]) == (free < 0.28 + room)


@both
def test_an_edge_of_an_obstacle_counts_where_it_is_in_reach(roads: RoadNetwork) -> None:
    corners = [on_lane(roads, OUT_WEST, *corner)[:2] for corner in ((2.5, -0.7), (3.6, -0.65), (3.6, 0.3))]
    wall = PolygonObstacle(tuple(corners))
    places = [on_lane(roads, OUT_WEST, s, -0.3) for s in (1.2, 2.2)]
    found = label([instance(roads, 2, obstacles=[wall])], [hold(*places, frames=1)])
    assert ["blocked" in flags(found, n)[0] for n in (0, 1)] == [False, True]


@both
def test_overtaking_lasts_until_the_block_is_passed_and_the_lane_taken(roads: RoadNetwork) -> None:
    path = [(1.2, -0.3), (1.4, 0.2), (2.2, 0.3), (3.19, 0.3), (3.21, 0.3), (3.25, -0.3), (3.26, -0.3)]
    longer = RoadNetwork(roads.segments, 6.0, roads.transform, roads.shape)
    stone = DiscObstacle(*on_lane(longer, OUT_WEST, 2.2, -0.3)[:2], 0.2)
    script = [[on_lane(longer, OUT_WEST, *place)] for place in path]
    found = flags(label([instance(longer, 1, obstacles=[stone])], [script]), 0)
    assert ["overtaking" in flag for flag in found] == [True, True, True, True, True, True, False]
    assert ["left" in flag for flag in found] == [False, True, True, True, True, False, False]


@both
def test_overtaking_goes_on_for_who_is_left_when_what_blocked_drives_off(roads: RoadNetwork) -> None:
    """The car ahead moves in frame 12, and stands no longer; the other comes over the line then, or a frame later."""
    parked, gone = on_lane(roads, OUT_WEST, 2.4, -0.3), on_lane(roads, OUT_WEST, 2.6, -0.3)
    behind, over = on_lane(roads, OUT_WEST, 1.3, -0.3), on_lane(roads, OUT_WEST, 1.32, 0.0)
    for late in (0, 1):
        script = [[behind, parked] for _ in range(12)]
        script += [[over if k >= late else behind, gone] for k in range(3)]
        found = flags(label([instance(roads, 2)], [script]), 0)
        assert ["overtaking" in flag for flag in found[11:]] == [True] + 3 * [late == 0]
        assert ["left" in flag for flag in found[11:]] == [False, late == 0, True, True]


@both
def test_overtaking_ends_on_entering_a_disc(roads: RoadNetwork) -> None:
    parked = on_lane(roads, WEST, 3.6, -0.3)
    script = [[on_lane(roads, WEST, s, 0.2), parked] for s in [2.2] * 12 + [4.0 - REACH - 0.01, 4.0 - REACH + 0.05]]
    found = flags(label([instance(roads, 2)], [script]), 0)
    assert "overtaking" in found[11]
    assert "overtaking" not in found[13]
    assert {"left", "entered"} <= found[13]


def test_a_frame_left_out_is_refused() -> None:
    state = State.zeros(1, 1)
    labeller = Labeller([instance(STAR, 1)])
    labeller.reset(state)
    with pytest.raises(ValueError, match="frame 1 must follow"):
        labeller.update(2, state, [()])


def test_lane_coordinates_are_offered() -> None:
    state = State.zeros(1, 1)
    fill(state, 0, [on_lane(STAR, SOUTH, 1.5, -0.25)])
    labeller = Labeller([instance(STAR, 1)])
    labeller.reset(state)
    found = [labeller.progress[0, 0], labeller.lateral[0, 0], labeller.reach[0, 0]]
    assert np.allclose(found, [1.5, -0.25, -0.25 + RHO], atol=1e-12)


def test_missing_cars_stay_unlabelled() -> None:
    scripts = [hold(far(STAR), frames=3), hold(far(STAR), far(STAR), frames=3)]
    labels = label([instance(STAR, 1), instance(STAR, 2)], scripts)[-1]
    assert labels.bits[0, 1] == 0
    assert labels.lane[0, 1] == -1
