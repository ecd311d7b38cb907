"""What each kind of e-agent does, on cases worked out by hand. Lane 28 of the grid leads to its lower right corner."""

import math

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.problem.kinds import KINDS, names
from dubins_traffic.roads.network import RoadNetwork
from tests.batches import pose
from tests.fleets import AWAY, GRID, first_commands, in_lane, instance, run

TEE = RoadNetwork.from_document(
    {
        "version": 0,
        "length": 3,
        "transform": [0, 0, 0],
        "shape": [2, 3],
        "segments": [[0, 0, 1, 0], [1, 0, 2, 0], [1, 0, 1, 1]],
    }
)
CORNER = GRID.segments.index((2, 0, 3, 0)) * 2
"""The lane to the lower right corner, whose only exit leads up."""


def lanes_driven(given, ticks):
    """Return the lanes that agent 0 drives, in order."""
    driven = []

    def each(now):
        lane = int(now.lanes[0, 1])
        if not driven or driven[-1] != lane:
            driven.append(lane)

    run([given], ticks, each)
    return driven


def wander(start, **more):
    """Return the first command of a wanderer alone, or with what `more` says."""
    starts = [AWAY, start, *more.pop("others", [])]
    kinds = [("wander", more.pop("given", {}))] + [("scripted", {"commands": []})] * (len(starts) - 2)
    return first_commands(instance(kinds, starts, **more))[0]


def test_names_say_what_the_kinds_do() -> None:
    own = {"wander", "loop", "follow", "parked", "scripted"}
    assert set(names()) == set(KINDS) == own | {"lawful", "nemesis", "chosen", "free", "nudged", "counter", "remote"}
    assert all(len(line) > 20 for line in names().values())


def test_begins_toward_the_end_of_its_lane() -> None:
    assert wander(in_lane(GRID, 0)) == (0.5, 0.0)
    assert wander(in_lane(GRID, 1)) == (0.5, 0.0)
    assert wander(pose(1.5, -0.42, 0.5)) == (0.0, -0.9)
    assert wander(pose(1.5, -0.42, -3.0)) == (
        0.0,
        -0.9,
    )  # headed back: to the end of the lane back, (0, 0.42)


def test_a_waypoint_is_reached_within_75_mm() -> None:
    driven = []
    run(
        [instance([("wander", {})], [AWAY, pose(7.5, -0.42)])],
        100,
        lambda now: driven.append((9.0 - now.state.x[0, 1], *now.commands[0, 1].tolist())),
    )
    before = [command[1:] for command in driven if command[0] > 0.075]
    after = [command[1:] for command in driven if command[0] < 0.075]
    assert before == [(0.5, 0.0)] * len(before)
    assert after == [(0.0, 0.9)] * len(after)
    assert len(before) > 80
    assert len(after) > 10


def test_drives_to_the_far_end_of_the_right_lane() -> None:
    state, _ = run([instance([("wander", {})], [AWAY, in_lane(GRID, CORNER)])], 30 * 6 + 30 * 7)
    assert state.x[0, 1] == pytest.approx(9.42, abs=0.1)
    assert state.y[0, 1] > 1.5


def test_comes_back_from_a_dead_end_in_its_right_lane() -> None:
    offsets = []

    def each(now):
        if now.lanes[0, 1] == 3 and 3.5 < now.state.x[0, 1] < 5.5:
            offsets.append(now.state.y[0, 1])

    run([instance([("wander", {})], [AWAY, in_lane(TEE, 2)], TEE)], 30 * 14, each)
    assert len(offsets) > 60
    assert min(offsets) > 0.3


@pytest.mark.parametrize("seed", [0, 1, 2**63 + 5])
def test_exits_are_equally_likely_and_never_back(seed) -> None:
    lane = GRID.segments.index((0, 1, 1, 1)) * 2
    start = in_lane(GRID, lane, 0.8)
    found = []

    def each(now):
        found[:] = now.lanes[:, 1].tolist()

    run([instance([("wander", {})], [AWAY, start], trial=trial, seed=seed) for trial in range(3000)], 40, each)
    share = {exit_: found.count(exit_) / 3000 for exit_ in set(found)}
    assert set(share) == set(GRID.successors(lane))
    assert all(abs(value - 1 / 3) < 4 * math.sqrt(2 / 9 / 3000) for value in share.values())


@pytest.mark.parametrize("turned", [-1.9, -0.8, 0.0, 1.3, 1.9])
def test_stands_while_a_surface_is_nearer_than_half_a_metre(turned) -> None:
    start = pose(1.5, -0.42)

    def other(distance):
        return pose(1.5 + distance * math.cos(turned), -0.42 + distance * math.sin(turned), 1.0)

    assert wander(start, others=[other(0.677 + 1e-9)]) == (0.5, 0.0)
    assert wander(start, others=[other(0.677 - 1e-9)]) == (0.0, 0.0)
    assert wander(pose(1.5, -0.42, 0.3), others=[other(0.677 + 1e-9)])[1] == -0.9
    assert wander(pose(1.5, -0.42, 0.3), others=[other(0.5)]) == (0.0, 0.0)


@pytest.mark.parametrize("side", [1, -1])
def test_sees_two_radians_to_either_side(side) -> None:
    start = pose(1.5, -0.42)
    edge = 2.0 + math.asin(0.01 / 0.4)  # a disc of 1 cm that touches the edge of the sector from outside

    def disc(angle):
        return DiscObstacle(1.5 + 0.4 * math.cos(angle), -0.42 + 0.4 * math.sin(angle), 0.01)

    assert wander(start, obstacles=[disc(side * (edge - 1e-6))]) == (0.0, 0.0)
    assert wander(start, obstacles=[disc(side * (edge + 1e-6))]) == (0.5, 0.0)
    assert wander(start, obstacles=[disc(math.pi)]) == (0.5, 0.0)


def test_stops_for_walls_and_rectangles() -> None:
    start = pose(1.5, -0.42)

    def wall(x):
        return PolygonObstacle(((x, -1.0), (x + 0.1, -1.0), (x + 0.1, 1.0), (x, 1.0)))

    assert wander(start, obstacles=[wall(2.0 + 1e-9)]) == (0.5, 0.0)
    assert wander(start, obstacles=[wall(2.0 - 1e-9)]) == (0.0, 0.0)
    car = Car(body=Rectangle(0.4, 0.2))
    assert wander(start, car=car, others=[pose(2.2 + 1e-9, -0.42)]) == (0.5, 0.0)
    assert wander(start, car=car, others=[pose(2.2 - 1e-9, -0.42)]) == (0.0, 0.0)
    assert wander(start, car=car, others=[pose(2.1 + 1e-9, -0.42, math.pi / 2)]) == (0.5, 0.0)


def test_keeps_a_metre_from_the_ego_but_may_turn() -> None:
    def command(theta, distance):
        return first_commands(instance([("wander", {})], [pose(1.5 + distance, -0.42), pose(1.5, -0.42, theta)]))[0]

    assert command(0.0, 1.0 + 1e-9) == (0.5, 0.0)
    assert command(0.0, 1.0) == (0.0, 0.0)
    assert command(0.3, 0.9) == (0.0, -0.9)
    assert command(0.3, 0.6) == (0.0, 0.0)


def test_parameters_change_the_law() -> None:
    given = {"speed": 0.3, "yaw_rate": 0.4, "stop_range": 0.3, "ego_range": 0.0, "bearing_tolerance": 0.2}
    assert wander(pose(1.5, -0.42, 0.15), given=given) == (0.3, 0.0)
    assert wander(pose(1.5, -0.42, 0.25), given=given) == (0.0, -0.4)
    assert wander(pose(1.5, -0.42), given=given, others=[pose(1.5 + 0.478, -0.42)]) == (0.3, 0.0)
    assert wander(pose(1.5, -0.42), given={"speed": 5.0}) == (0.7, 0.0)
    slow = Car(bounds=Bounds(speed=0.2, yaw_rate=0.1))
    assert wander(pose(1.5, -0.42), car=slow) == (0.2, 0.0)
    assert wander(pose(1.5, -0.42, 0.3), car=slow) == (0.0, -0.1)


def test_two_that_face_stand_for_ever_unless_patient() -> None:
    starts = [AWAY, pose(1.0, -0.42), pose(1.6, -0.42, math.pi)]
    state, _ = run([instance([("wander", {})] * 2, starts)], 600)
    assert state.x[0, 1:].tolist() == [1.0, 1.6]
    state, contacts = run([instance([("wander", {"patience": 1.0})] * 2, starts)], 900)
    assert not contacts
    assert math.dist((state.x[0, 1], state.y[0, 1]), (state.x[0, 2], state.y[0, 2])) > 1.0


def test_loop_goes_round_its_cycle() -> None:
    cycle = [[0, 0], [1, 0], [1, 1], [0, 1]]
    around = [
        2 * GRID.segments.index((0, 0, 1, 0)),
        2 * GRID.segments.index((1, 0, 1, 1)),
        2 * GRID.segments.index((0, 1, 1, 1)) + 1,
        2 * GRID.segments.index((0, 0, 0, 1)) + 1,
    ]
    given = instance([("loop", {"cycle": cycle})], [AWAY, in_lane(GRID, around[1])])
    assert lanes_driven(given, 2400)[:9] == (around[1:] + around * 3)[:9]
    far = instance([("loop", {"cycle": cycle})], [AWAY, in_lane(GRID, CORNER)])
    driven = lanes_driven(far, 3000)
    begun = next(k for k, lane in enumerate(driven) if lane in around)
    assert begun == 4  # up, back along the middle, and on it
    first = around.index(driven[begun])
    assert driven[begun:] == [around[(first + k) % 4] for k in range(len(driven) - begun)]


def test_loop_refuses_a_cycle_that_is_none() -> None:
    with pytest.raises(InputError, match="cycle"):
        first_commands(instance([("loop", {"cycle": [[0, 0], [2, 0]]})], [AWAY, in_lane(GRID, 0)]))


def test_follow_keeps_its_gap_along_the_path_of_the_ego() -> None:
    straight, arc = [(0.4, 0.0)] * 150, [(0.4, 0.8)] * 59
    ego = (straight + arc) * 6
    path, gaps = [], []

    def each(now):
        path.append((now.state.x[0, 0], now.state.y[0, 0]))
        if now.tick > 300:
            del path[:-200]
            away = np.hypot(*(np.array(path) - (now.state.x[0, 1], now.state.y[0, 1])).T)
            nearest = int(away.argmin())
            gaps.append(0.4 / 30 * (len(path) - 1 - nearest))
            assert away[nearest] < 0.1

    starts = [pose(1.5, -0.42), pose(0.0, -0.42)]
    _, contacts = run([instance([("follow", {"gap": 1.2})], starts)], len(ego), each, ego)
    assert not contacts
    assert min(gaps) > 1.1
    assert max(gaps) < 1.45


def test_follow_stands_behind_an_ego_that_stands() -> None:
    starts = [pose(2.0, -0.42), pose(0.5, -0.42)]
    state, _ = run([instance([("follow", {"gap": 0.9})], starts)], 300)
    # no path yet but the point on which the ego stands: it comes near that, and no nearer than its stop range
    assert 0.677 - 0.02 < state.x[0, 0] - state.x[0, 1] < 0.9 + 1e-9


def test_follow_by_sensing_knows_nothing_of_an_ego_out_of_sight() -> None:
    def end(ego, sensing, ticks=900):
        given = instance([("follow", {"sensing_only": sensing})], [ego, in_lane(GRID, CORNER)])
        state, _ = run([given], ticks)
        return state.x[0, 1], state.y[0, 1]

    near, far = in_lane(GRID, 0, 0.2), in_lane(GRID, 1, 0.9)
    assert end(near, sensing=True, ticks=300) == end(far, sensing=True, ticks=300)
    assert end(near, sensing=False) != end(far, sensing=False)


def test_parked_vacates_at_the_tick() -> None:
    for after, first in ((1.0, 30), (0.0, 0), (0.95, 29), (None, None)):
        moved = []

        def each(now, moved=moved):
            if now.commands[0, 1].any():
                moved.append(now.tick)

        run([instance([("parked", {"vacates_after": after})], [AWAY, in_lane(GRID, 0)])], 90, each)
        assert moved[:1] == ([] if first is None else [first])


def test_scripted_plays_exactly() -> None:
    commands = [[0.1, 0.3, 0.1], [0.0, 9.0, 9.0], [0.05, -0.2, 0.0], [0.15, 0.0, -1.0]]
    # the script's times 0.1, 0.1, 0.15, 0.3 s are the ticks 3, 3, 5, 9
    once = [(0.3, 0.1)] * 3 + [(-0.2, 0.0)] * 2 + [(0.0, -1.0)] * 4
    for repeat, expected in ((False, once + [(0.0, 0.0)] * 9), (True, once * 2)):
        played = []

        def each(now, played=played):
            played.append(tuple(now.commands[0, 1].tolist()))

        given = {"commands": commands, "repeat": repeat}
        run([instance([("scripted", given)], [AWAY, in_lane(GRID, 0)])], 18, each)
        assert played == expected


def test_scripted_holds_a_command_for_as_long_as_a_float_can_say() -> None:
    given = {"commands": [[1.7e308, 0.1, 0.2], [1.7e308, 0.3, 0.0]]}
    assert first_commands(instance([("scripted", given)], [AWAY, in_lane(GRID, 0)])) == [(0.1, 0.2)]


def test_scripted_without_commands_stands() -> None:
    for given in ({"commands": []}, {"commands": [[0.0, 1.0, 1.0]], "repeat": True}):
        assert first_commands(instance([("scripted", given)], [AWAY, in_lane(GRID, 0)])) == [(0.0, 0.0)]


def test_commands_of_the_ego_are_left_alone() -> None:
    seen = []
    run(
        [instance([("wander", {})], [in_lane(GRID, 5), in_lane(GRID, 0)]), instance([], [in_lane(GRID, 5)])],
        3,
        lambda now: seen.append(now.commands[:, 0].tolist()),
        [(0.1, 0.2)] * 3,
    )
    assert seen == [[[0.1, 0.2], [0.1, 0.2]]] * 3


def test_an_unknown_kind_is_refused() -> None:
    with pytest.raises(InputError, match="kind"):
        first_commands(instance([("stroll", {})], [AWAY, Pose(0.0, 0.0, 1.0, 0.0)]))
