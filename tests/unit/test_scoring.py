import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from dubins_traffic.cars.body import Body, Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Contact, Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.wall import measured
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.scoring.collisions import collisions_of
from dubins_traffic.scoring.counts import early_rounds
from dubins_traffic.scoring.driving import Driven, driven_of
from dubins_traffic.scoring.findings import Findings
from dubins_traffic.scoring.goals import GoalVisits, Visits
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.score import Scorer, ScoreSheet
from tests.recordings import blocks, feed, make_frames, make_instance

A, B, C, ROAD = (0.2, 0.1), (6.0, 3.5), (3.0, 0.1), (1.5, 0.0)


def counted(instance: Instance, frames: Frames, size: int = 30) -> Findings:
    """Return what is counted in frames that come in blocks of `size`."""
    judging = Judging()
    judging.begin(instance)
    for block in blocks(frames, size):
        judging.frames(block)
    return judging.findings()


def visits(path: list[tuple[float, float]], **settings: object) -> Visits:
    instance = make_instance(**settings)
    return counted(instance, make_frames(instance, path)).visits


def test_a_visit_is_an_entry_and_a_start_inside_counts() -> None:
    path = [A] * 31 + [C] * 30 + [A] * 30 + [B] * 60 + [ROAD] * 30
    found = visits(path)
    assert found == Visits(
        (GoalVisits((0, 0), 2, (180 - 61) / 30.0), GoalVisits((2, 1), 1, 91 / 30.0)), 1.0, 1, recurrent=False
    )


@pytest.mark.parametrize("size", [1, 7, 1000])
def test_between_two_visits_of_a_goal_is_another_disc(size: int) -> None:
    """Swinging over the edge of a disc is no visit; one goal counts as another disc for another."""
    instance = make_instance(goals=[(0, 0), (2, 1)], ticks=13)
    path = [A, ROAD, A, ROAD, C, ROAD, ROAD, A, ROAD, A, B, ROAD, B, A]
    found = counted(instance, make_frames(instance, path), size)
    rate = instance.problem.rate
    assert found.visits.goals[0] == GoalVisits((0, 0), 3, 7 / rate)
    assert found.visits.goals[1].visits == 1
    assert found.visits.rounds == 1
    assert [goal.last_visit == found.last for goal in found.goals] == [True, False]


def test_entries_while_inside_at_the_block_border_are_not_counted_again() -> None:
    assert visits([ROAD] * 29 + [A] * 62, goals=[(0, 0)]).goals == (GoalVisits((0, 0), 1, 61 / 30.0),)


def test_gaps_run_to_the_planned_end() -> None:
    found = visits([ROAD] * 10 + [A] * 5, goals=[(0, 0)], ticks=90)
    assert found.goals == (GoalVisits((0, 0), 1, 80 / 30.0),)


def test_a_goal_never_visited_has_the_whole_trial_as_its_gap() -> None:
    found = visits([A] * 61, ticks=60)
    assert found.visited == 0.5
    assert found.rounds == 0
    assert found.goals[1] == GoalVisits((2, 1), 0, 2.0)


def test_rounds_by_visits() -> None:
    assert visits([A, ROAD, A, ROAD, A], goals=[(0, 0)]).rounds == 1
    assert visits([A, C, A, ROAD, C, A], goals=[(0, 0)]).rounds == 3
    assert visits([A] * 5, goals=[(0, 0)]).rounds == 1
    assert visits([A, B, A, B, B, A]).rounds == 2
    assert visits([A, B], goals=[(0, 0), (2, 1), (0, 0)]).rounds == 1


@pytest.mark.parametrize("size", [1, 3, 1000])
def test_rounds_before_a_breach_count_the_share_of_the_round_begun(size: int) -> None:
    """The visit at frame 0 does not count: who stands in a goal has none, and the first round needs all goals again."""
    instance = make_instance(goals=[(0, 0), (2, 1)], ticks=6)
    frames = make_frames(instance, [A, B, A, ROAD, C, B, A])
    wanted = [0.0, 0.5, 1.0, 1.0, 1.0, 1.5, 2.0]
    for last, rounds in enumerate(wanted):
        early = counted(instance, replace(frames, contacts=(contact(last, 0, 1),)), size).tally.early[0]
        assert early_rounds(early, 2, None) == rounds
    assert early_rounds(counted(instance, frames, size).tally.early[0], 2, None) == wanted[-1]


@pytest.mark.parametrize(
    ("end", "contacts", "wanted"),
    [
        (End.DURATION, [], 2.0),
        (End.DURATION, [Contact(2, 2 / 30, 0, 1, 0.0, 0.0, 1.0, 0.0, (1.0, 0.0), (True, False))], 1.0),
        (End.GAVE_UP, [], 0.0),
        (End.CONTROLLER_FAULT, [], 0.0),
        (End.INTERRUPTED, [], 2.0),
    ],
)
def test_no_round_counts_after_a_breach_or_if_the_controller_ended_the_trial(
    end: End, contacts: list[Contact], wanted: float
) -> None:
    instance = make_instance(goals=[(0, 0), (2, 1)], ticks=6)
    frames = replace(make_frames(instance, [A, B, A, ROAD, C, B, A]), contacts=tuple(contacts))
    scorer = Scorer()
    scorer.begin(instance)
    scorer.frames(frames)
    scorer.end(Ending(end, 6))
    assert scorer.result().rounds_before_breach == wanted


def test_who_stands_in_a_goal_has_no_round_before_a_breach() -> None:
    instance = make_instance(goals=[(0, 0)], ticks=9)
    scorer = Scorer()
    feed(instance, make_frames(instance, [A] * 10), scorer)
    assert (scorer.result().rounds, scorer.result().rounds_before_breach) == (1, 0.0)


def test_without_goals_there_are_no_rounds_and_nothing_is_missed() -> None:
    assert visits([A] * 5, goals=[]) == Visits((), 1.0, 0, recurrent=True)


def drive(frames: Frames) -> Driven:
    found = counted(make_instance(), frames)
    return driven_of(found.counts, frames.rate, found.last)


def bits(frames: Frames, ego: list[int]) -> Frames:
    flags = np.full(frames.bits.shape, FLAG.ON_ROAD, dtype=np.uint32)
    flags[:, 0] = ego
    return replace(frames, bits=flags)


def test_distance_and_standing() -> None:
    step = 0.5 / 30
    ego = [(step * k, 0.0) for k in range(46)] + [(step * 45, 0.0)] * 45
    found = drive(bits(make_frames(make_instance(), ego), [FLAG.ON_ROAD] * 91))
    assert found.distance_m == pytest.approx(0.75, rel=1e-12)
    assert found.standing_share == 0.5
    assert found.off_road_s == 0.0
    creep = [(0.04 / 30 * k, 0.0) for k in range(61)]
    assert drive(bits(make_frames(make_instance(), creep), [FLAG.ON_ROAD] * 61)).standing_share == 1.0


def test_time_off_the_road_is_that_of_the_ticks_that_end_there() -> None:
    frames = make_frames(make_instance(), [ROAD] * 61)
    found = drive(bits(frames, [0] + [FLAG.ON_ROAD] * 30 + [FLAG.STILL] * 15 + [FLAG.ON_ROAD] * 15))
    assert (found.off_road_s, found.off_road_share) == (0.5, 0.25)


def test_departures_from_the_lane_count_while_others_move() -> None:
    instance = make_instance()
    moving = [(9.0 + 0.01 * k, 9.0) for k in range(31)] + [(9.3, 9.0)] * 30
    frames = make_frames(instance, [ROAD] * 61, moving)
    left = [FLAG.ON_ROAD | FLAG.LEFT if k in (0, 1, 5, 6, 7, 20, 29, 30, 40, 50) else FLAG.ON_ROAD for k in range(61)]
    assert drive(bits(frames, left)).lane_departures == 3, "those at frames 5, 20 and 29"


def test_one_frame_makes_no_tick() -> None:
    assert drive(make_frames(make_instance(), [ROAD])) == Driven(0.0, 0.0, 0.0, 0.0, 0)


def contact(tick: int, car: int, other: int, fault: tuple[bool, bool] = (False, False)) -> Contact:
    return Contact(tick, tick / 30, car, other, 0.0, 0.0, 1.0, 0.0, (0.5, 0.0), (True, False), fault)


def test_collisions_of_the_ego_and_of_others() -> None:
    instance = make_instance()
    contacts = (
        contact(3, 0, 2, (True, False)),
        contact(4, 1, 2),
        contact(40, 1, 0, (True, False)),
        contact(50, 0, -3),
    )
    found, among_others = collisions_of(instance.names, contacts)
    assert among_others == 1
    assert [one.to_json() for one in found] == [
        {"time": 0.1, "tick": 3, "car": "ego", "with": "agent1", "at_fault": True, "with_at_fault": False},
        {
            "time": 40 / 30,
            "tick": 40,
            "car": "ego",
            "with": "agent0",
            "at_fault": False,
            "with_at_fault": True,
        },
        {
            "time": 50 / 30,
            "tick": 50,
            "car": "ego",
            "with": "obstacle 2",
            "at_fault": False,
            "with_at_fault": False,
        },
    ]


def clearance(ego: list[tuple[float, float]], *others: list[tuple[float, float]], heading: float = 0.0, **settings):
    instance = make_instance(**settings)
    frames = make_frames(instance, ego, *others)
    turned = np.full(frames.x.shape, heading)
    return counted(instance, replace(frames, c=np.cos(turned), s=np.sin(turned))).gap


BOX = Rectangle(0.5, 0.3)


@pytest.mark.parametrize(
    ("body", "place", "heading", "expected"),
    [
        (Disc(0.2), (3.0, 4.0), 0.0, 4.6),
        (Disc(0.2), (0.3, 0.0), 0.0, 0.0),
        (BOX, (1.0, 0.0), 0.0, 0.5),
        (BOX, (0.0, 1.0), 0.0, 0.7),
        (BOX, (1.0, 0.0), np.pi / 2, 0.7),
        (BOX, (0.8, 0.7), 0.0, 0.5),
        (BOX, (0.1, 0.1), 0.3, 0.0),
    ],
)
def test_clearance_of_cars(body: Body, place: tuple[float, float], heading: float, expected: float) -> None:
    ego = [(0.0, 0.0)] * 3
    other = [(50.0, 0.0), place, (50.0, 0.0)]
    assert clearance(ego, other, heading=heading, body=body) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("body", [Disc(0.2), Rectangle(0.4, 0.4)])
def test_clearance_of_obstacles(body: Body) -> None:
    obstacles = [
        DiscObstacle(3.0, 0.0, 0.5),
        PolygonObstacle(((1.0, 5.0), (2.0, 5.0), (1.0, 5.2), (0.0, 6.0))),
    ]
    settings = {"names": [], "obstacles": obstacles, "body": body}
    assert clearance([(0.0, 0.0)], **settings) == pytest.approx(2.3)
    assert clearance([(0.0, 0.0), (1.4, 4.0)], **settings) == pytest.approx(0.8)
    assert clearance([(1.4, 5.0)], **settings) == 0.0


def test_without_anything_else_there_is_no_clearance() -> None:
    assert clearance([(0.0, 0.0)], names=[]) is None


def test_a_contact_leaves_no_clearance() -> None:
    instance = make_instance()
    frames = make_frames(instance, [ROAD] * 61)
    assert counted(instance, replace(frames, contacts=(contact(3, 1, 2),))).gap > 100
    assert counted(instance, replace(frames, contacts=(contact(3, 1, 2), contact(9, 0, 2)))).gap == 0.0


def test_the_score_as_json() -> None:
    instance = make_instance()
    scorer = Scorer()
    feed(instance, make_frames(instance, [A] * 61), scorer, ending=Ending(End.GAVE_UP, 60))
    score = scorer.result(controller="there/mine.py:Mine", record="out/trial-3.mcap", wall=measured(0.5, {}))
    document = score.to_json()
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    expected = {
        "trial": 3,
        "seed": 7,
        "end": "gave_up",
        "controller": "mine.py:Mine",
        "ran": "in process",
        "record": "out/trial-3.mcap",
        "duration_s": 2.0,
        "rounds": 0,
        "counted_rounds": 0,
        "rounds_before_breach": 0.0,
        "goals_visited": 0.5,
        "goals": [
            {"goal": [0, 0], "visits": 1, "longest_gap_s": 3.0},
            {"goal": [2, 1], "visits": 0, "longest_gap_s": 3.0},
        ],
        "collisions": [],
        "collisions_among_others": 0,
        "distance_m": 0.0,
        "standing_share": 1.0,
        "off_road_s": 2.0,
        "off_road_share": 1.0,
        "lane_departures": 0,
        "min_clearance_m": pytest.approx(1412.0, abs=20.0),
        "time_to_begin_s": 0.5,
        "verdict": None,
        "formulas": [],
        "paper_score": 0.0,
        "icra2016": 0.0,
        "interventions": 0,
    }
    assert document == expected
    assert list(document) == list(expected)


def test_what_was_not_measured_is_null() -> None:
    instance = make_instance(names=[])
    scorer = Scorer()
    scorer.begin(instance)
    document = scorer.result().to_json()
    for name in ("end", "controller", "record", "min_clearance_m", "time_to_begin_s"):
        assert document[name] is None


def test_the_sheet_sums_the_scores() -> None:
    instance = make_instance(goals=[(0, 0)])
    scores = []
    for count in (3, 5):
        scorer = Scorer()
        feed(instance, make_frames(instance, [A] * count), scorer)
        scores.append(scorer.result())
    sheet = ScoreSheet(tuple(scores))
    assert sheet.icra2016_sum == 24 * 8
    sums = {
        "cut": 0,
        "ended_by_controller": 0,
        "counted_rounds_sum": 0,
        "paper_sum": 48.0,
        "icra2016_sum": 192.0,
    }
    assert sheet.to_json() == {"trials": [score.to_json() for score in scores], **sums}
    assert ScoreSheet(()).to_json() == {"trials": [], **dict.fromkeys(sums, 0)}


def test_scoring_a_record_does_not_load_the_compiler() -> None:
    code = "import sys, dubins_traffic.scoring.score, dubins_traffic.interchange.export; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
    assert "dubins_traffic.record.reader" in loaded
    assert not {"numba", "pyarrow", "matplotlib", "typer", "rich"} & set(loaded)
