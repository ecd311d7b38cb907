"""The score of ICRA 2016 against hand-computed cases and a plain sample-by-sample reading of its definition."""

import math
from collections.abc import Sequence

import numpy as np
import pytest

from dubins_traffic.cars.state import Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.score import Scorer
from tests.recordings import feed, make_frames, make_instance, random_frames


def metric(instance: Instance, frames: Frames) -> tuple[float | None, float]:
    """Return the score of some frames, and the seconds off the road that it counts."""
    scorer, judging = Scorer(), Judging()
    feed(instance, frames, scorer, judging)
    return scorer.result().icra2016, judging.findings().counts.off_ticks / instance.problem.rate


def definition(instance: Instance, frames: Frames) -> float | None:
    """The definition, sample by sample, in plain Python."""
    problem = instance.problem
    samples = [(float(x), float(y)) for x, y in zip(frames.x[:, 0], frames.y[:, 0], strict=True)]
    agents = [n for n, name in enumerate(instance.names) if name.startswith("agent")]
    if len(instance.names) > 1 and not agents:
        return None
    for n in agents:
        for (x, y), ox, oy in zip(samples, frames.x[:, n], frames.y[:, n], strict=True):
            if math.hypot(x - ox, y - oy) < 0.36:
                return -1.0
    off, since = 0.0, None
    for k, (x, y) in enumerate(samples):
        on = on_road(instance, x, y)
        if not on and since is None:
            since = k
        elif on and since is not None:
            off += (k - since) / problem.rate
            since = None
    rounds, seen = 0, set()
    for x, y in samples:
        for goal in problem.goals:
            gx, gy = problem.network.to_world(np.array([goal], dtype=float))[0]
            if math.hypot(x - gx, y - gy) < problem.intersection_radius:
                seen.add(goal)
        if seen == set(problem.goals):
            rounds, seen = rounds + 1, set()
    rows, columns = problem.network.shape
    return len(agents) * rows * columns * rounds / max(1, off)


def on_road(instance: Instance, x: float, y: float) -> bool:
    network = instance.problem.network
    for x0, y0, x1, y1 in network.segments:
        (ax, ay), (bx, by) = network.to_world(np.array([(x0, y0), (x1, y1)], dtype=float))
        length = math.hypot(bx - ax, by - ay)
        tx, ty = (bx - ax) / length, (by - ay) / length
        if 0 <= (x - ax) * tx + (y - ay) * ty <= length and abs((x - ax) * ty - (y - ay) * tx) <= 0.6:
            return True
    return False


def still(place: tuple[float, float], count: int) -> list[tuple[float, float]]:
    return [place] * count


ON = (1.5, 0.0)
AT_00, AT_21 = (0.5, 0.2), (6.0, 3.5)
OFF = (1.5, 1.0)


def score(
    ego: Sequence[tuple[float, float]], *others: Sequence[tuple[float, float]], **settings: object
) -> float | None:
    instance = make_instance(**settings)
    frames = make_frames(instance, ego, *others)
    result, _ = metric(instance, frames)
    expected = definition(instance, frames)
    assert result == (None if expected is None else pytest.approx(expected, rel=1e-12))
    return result


@pytest.mark.parametrize("inside", [1, 7, 40])
def test_with_one_goal_every_sample_inside_is_a_round(inside: int) -> None:
    ego = still(ON, 10) + still(AT_00, inside) + still(ON, 10)
    assert score(ego, goals=[(0, 0)]) == 2 * 12 * inside


def test_a_whole_trial_in_the_only_goal() -> None:
    assert score(still(AT_00, 1800), goals=[(0, 0)], ticks=1799) == 2 * 12 * 1800


def test_without_goals_every_sample_is_a_round() -> None:
    assert score(still(ON, 91), goals=[]) == 2 * 12 * 91


def test_two_goals_make_a_round_when_both_were_seen() -> None:
    ego = still(AT_00, 5) + still(ON, 3) + still(AT_21, 4) + still(ON, 30)
    assert score(ego) == 24 * 1
    ego = still(AT_00, 5) + still(AT_21, 1) + still(AT_00, 1)
    assert score(ego) == 24 * 1, "the first sample back starts the next round"
    assert score([*ego, AT_21]) == 24 * 2


def test_a_goal_twice_is_one_goal() -> None:
    assert score(still(AT_00, 5), goals=[(0, 0), (0, 0)]) == 24 * 5


def test_the_radius_itself_is_outside() -> None:
    assert score([(1.0, 0.0)], goals=[(0, 0)]) == 0
    assert score([(np.nextafter(1.0, 0.0), 0.0)], goals=[(0, 0)]) == 24


def test_a_collision_costs_everything() -> None:
    ego = still(AT_00, 30)
    assert score(ego, [*still((9.0, 9.0), 29), (0.5, 0.2 + 0.359)], goals=[(0, 0)]) == -1
    assert score(ego, [*still((9.0, 9.0), 29), (0.5, 0.2 + 0.361)], goals=[(0, 0)]) == 24 * 30


def test_centres_at_the_distance_itself_do_not_collide() -> None:
    assert score([(0.0, 0.0)], [(0.36, 0.0)], goals=[(0, 0)]) == 24
    assert score([(0.0, 0.0)], [(np.nextafter(0.36, 0.0), 0.0)], goals=[(0, 0)]) == -1


def test_only_models_called_agent_count() -> None:
    ego = still(AT_00, 5)
    other = still((0.5, 0.3), 5)
    assert score(ego, other, goals=[(0, 0)], names=["truck"]) is None, "the formula does not apply"
    assert score(ego, other, goals=[(0, 0)], names=["truck", "agent7", "agents"]) == 2 * 12 * 5
    assert score(ego, goals=[(0, 0)], names=[]) == 0


def test_time_off_the_road_divides() -> None:
    ego = still(AT_00, 10) + still(OFF, 60) + still(ON, 1)
    assert score(ego, goals=[(0, 0)]) == 24 * 10 / 2.0
    twice = ego + still(OFF, 30) + still(ON, 5)
    assert score(twice, goals=[(0, 0)]) == 24 * 10 / 3.0


def test_less_than_a_second_off_the_road_is_free() -> None:
    assert score(still(AT_00, 10) + still(OFF, 29) + still(ON, 1), goals=[(0, 0)]) == 24 * 10


def test_time_off_the_road_until_the_last_sample_is_free() -> None:
    assert score(still(AT_00, 10) + still(OFF, 300), goals=[(0, 0)]) == 24 * 10
    assert score(still(OFF, 90) + still(AT_00, 10) + still(OFF, 300), goals=[(0, 0)]) == 24 * 10 / 3.0


def test_the_road_has_no_rounded_ends() -> None:
    beyond = (-0.1, 0.5)
    assert score(still(AT_00, 10) + still(beyond, 60) + still(ON, 1), goals=[(1, 0)]) == 0
    instance = make_instance(goals=[(0, 0)])
    corner = make_frames(instance, still((-0.5, -0.1), 60) + still((0.0, 0.0), 1))
    assert metric(instance, corner)[1] == 2.0, "within 0.6 m of the corner, beside no segment"
    edge = make_frames(instance, still((1.5, -0.6), 60) + still((1.5, np.nextafter(-0.6, -1.0)), 60) + still(ON, 1))
    assert metric(instance, edge)[1] == 2.0, "0.6 m is on the road"


@pytest.mark.parametrize("seed", range(30))
def test_random_walks_score_as_defined(seed: int) -> None:
    goals = [[(0, 0)], [(0, 0), (1, 0)], [(0, 0), (1, 1), (0, 1)], []][seed % 4]
    instance = make_instance(goals=goals, names=["agent0", "agent1"], rate=[30.0, 7.5, 10.0][seed % 3])
    frames = random_frames(instance, seed, 400)
    frames = make_frames(instance, np.column_stack([frames.x[:, 0], frames.y[:, 0]]) * 0.4)
    assert metric(instance, frames)[0] == pytest.approx(definition(instance, frames), rel=1e-12)
