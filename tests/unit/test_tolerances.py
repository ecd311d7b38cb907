"""Both sides of the tolerances on which a rule depends by way of a proposition, on a grid and on a turned kite."""

from __future__ import annotations

import pytest

from dubins_traffic.roads.network import RoadNetwork
from tests.judging import EPS, GRID, RHO, ROADS, before, case, judged, lanes_in, said
from tests.rules_scripts import KITE, Frame, on_lane

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)
anybody = pytest.mark.parametrize("who", [0, 1], ids=["ego", "agent"])
Place = tuple[float, ...]


def frames(who: int, mine: list[Place], *others: list[Place]) -> list[Frame]:
    """Return a script in which car `who` takes `mine`, and the rest the others' places, all of one length."""
    cars = list(others)
    cars.insert(who, mine)
    return [list(frame) for frame in zip(*cars, strict=True)]


def left_after(roads: RoadNetwork, who: int, ticks: int, *others: list[Place], s: float = 1.3) -> list[Frame]:
    """Return a script in which a car waits for so many frames and is left in the next."""
    lane = lanes_in(roads)[0]
    mine = [on_lane(roads, lane, s, -0.3)] * ticks + [on_lane(roads, lane, s, 0.0)]
    return frames(who, mine, *others)


@both
@anybody
@pytest.mark.parametrize(("ticks", "rules"), [(9, ["2.left"]), (10, [])])
def test_what_blocks_has_stood_for_a_second(roads: RoadNetwork, who: int, ticks: int, rules: list[str]) -> None:
    stands = [on_lane(roads, lanes_in(roads)[0], 2.2, -0.3)] * (ticks + 1)
    found = judged(case(roads, 2), left_after(roads, who, ticks, stands))
    assert said(found) == [(rule, who, ticks, ticks) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("way", "rules"), [(0.05 - EPS, []), (0.05 + EPS, ["2.left"])])
def test_what_blocks_has_hardly_moved(roads: RoadNetwork, who: int, way: float, rules: list[str]) -> None:
    lane = lanes_in(roads)[0]
    creeps = [on_lane(roads, lane, 2.2 + way * k / 10, -0.3) for k in range(11)]
    found = judged(case(roads, 2), left_after(roads, who, 10, creeps))
    assert said(found) == [(rule, who, 10, 10) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("room", "rules"), [(0.1 - EPS, []), (0.1 + EPS, ["2.left"])])
def test_what_blocks_leaves_too_little_of_the_lane(roads: RoadNetwork, who: int, room: float, rules: list[str]) -> None:
    """It stands beyond the lane's right edge so far that a body and `room` fit beside it, or at its left edge."""
    lane = lanes_in(roads)[0]
    for lateral in (-2.0 * RHO - room - RHO, -0.6 + 2.0 * RHO + room + RHO):
        thing = [on_lane(roads, lane, 2.2, lateral)] * 13
        found = [row for row in said(judged(case(roads, 2), left_after(roads, who, 12, thing))) if row[1] == who]
        assert found == [(rule, who, 12, 12) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("behind", "rules"), [(1.0 - EPS, ["2.left"]), (1.0 + EPS, [])])
def test_who_waits_behind_the_first_of_a_queue_is_no_reason(
    roads: RoadNetwork, who: int, behind: float, rules: list[str]
) -> None:
    lane = lanes_in(roads)[0]
    first = float(roads.lengths[lane // 2]) - 1.5
    waits = [on_lane(roads, lane, first, -0.3)] * 13
    second = [on_lane(roads, lane, first - behind, -0.3)] * 13
    script = left_after(roads, who, 12, waits, second, s=first - behind - 0.6)
    assert said(judged(case(roads, 3), script)) == [(rule, who, 12, 12) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("past", "rules"), [(0.8 - EPS, []), (0.8 + EPS, ["2.left"])])
def test_overtaking_ends_behind_what_was_passed(roads: RoadNetwork, who: int, past: float, rules: list[str]) -> None:
    """The car is back in its lane for a moment, beside or beyond what it passed, and left again."""
    lane, at = lanes_in(roads)[0], 2.0
    mine = [on_lane(roads, lane, at - 0.6, -0.3)] * 12 + [on_lane(roads, lane, at - 0.6, 0.2)]
    mine += [on_lane(roads, lane, at + past, -0.3)] * 2 + [on_lane(roads, lane, at + past, 0.2)]
    stands = [on_lane(roads, lane, at, -0.3)] * len(mine)
    found = judged(case(roads, 2), frames(who, mine, stands))
    assert said(found) == [(rule, who, 15, 15) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("ahead", "rules"), [(1.6 - EPS, []), (1.6 + EPS, ["2.left"])])
def test_overtaking_ends_when_what_blocked_is_far_ahead(
    roads: RoadNetwork, who: int, ahead: float, rules: list[str]
) -> None:
    """The car backs up a little, until nothing blocks its lane any more."""
    lane, at = lanes_in(roads)[0], 2.8
    mine = [on_lane(roads, lane, at - 1.4, -0.3)] * 12
    mine += [on_lane(roads, lane, at - ahead, -0.3)] * 2 + [on_lane(roads, lane, at - ahead, 0.2)]
    stands = [on_lane(roads, lane, at, -0.3)] * len(mine)
    found = judged(case(roads, 2, overtaking_ahead=1.6, approach_distance=0.1), frames(who, mine, stands))
    assert said(found) == [(rule, who, 14, 14) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("gap", "rules"), [(0.5 - EPS, []), (0.5 + EPS, ["3.stop"])])
def test_who_backs_off_from_the_crossing_loses_his_stop(
    roads: RoadNetwork, who: int, gap: float, rules: list[str]
) -> None:
    lane = lanes_in(roads)[0]
    gaps = [0.3] * 7 + [gap, 0.1, EPS, -EPS]
    mine = [before(roads, lane, own) for own in gaps]
    away = [on_lane(roads, lane ^ 1, 2.0, -0.3)] * len(mine)
    found = judged(case(roads, 2), frames(who, mine, away))
    assert said(found) == [(rule, who, 10, 10) for rule in rules]


@both
@anybody
@pytest.mark.parametrize(("stop", "rules"), [(34, []), (35, ["3.order"])])
def test_who_is_first_for_three_seconds_and_does_not_enter_is_last(
    roads: RoadNetwork, who: int, stop: int, rules: list[str]
) -> None:
    """He stops at 5 and holds a new ticket from 35 on; the other has stopped at 15."""
    lane, other = lanes_in(roads)[:2]
    mine = [before(roads, lane, 0.3)] * stop + [before(roads, lane, EPS), before(roads, lane, -EPS)]
    late = [before(roads, other, 0.9 if k < 10 else 0.3) for k in range(len(mine))]
    found = judged(case(roads, 2), frames(who, mine, late))
    assert said(found) == [(rule, who, stop + 1, stop + 1) for rule in rules]


@pytest.mark.parametrize("roads", [GRID, KITE], ids=["grid", "kite"])
@pytest.mark.parametrize(("degree", "rules"), [(2, ["3.stop"]), (3, [])])
def test_a_bend_is_a_crossing_only_if_its_degree_says_so(roads: RoadNetwork, degree: int, rules: list[str]) -> None:
    lane = next(lane for lane in range(roads.lanes) if len(roads.arms(roads.lane_ends(lane)[1])) == 2)
    script = [[before(roads, lane, gap)] for gap in (0.3, EPS, -EPS)]
    assert said(judged(case(roads, 1, crossing_degree=degree), script)) == [(rule, 0, 2, 2) for rule in rules]
