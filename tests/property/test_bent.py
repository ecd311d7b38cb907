"""On roads that bend, too: a batch equals its trials and their records, a rigid motion of the map commutes with a
trial, and the referee agrees with the slow judge.
"""

from __future__ import annotations

import cmath
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.body import DiscObstacle
from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.reader import read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score, score
from tests.chain_reference import RING, SNAKE, Track
from tests.judge_trials import BENT, compare

SEED = 4
SHIFT, TURN = complex(-31.0, 17.5), 2.2
EXPECTED = ("2.left", "2.return", "E4", "E5", "3.stop", "nearer", "way back")
"""What happens in the trials of the slow judge."""


def _configured(**more: Any) -> Configuration:
    document = {
        "version": 1, "problem_domain": "dubins_traffic", "rules": True, "number_trials": 3,
        "network": {"random": {"intersections": 6, "segments": 7, "bent": 1.0, "rigid_motion": True}},
        "e-agents": [
            {"type": "lawful", "name": "agent", "count": 3},
            {"type": "lawful", "name": "rogue", "parameters": {"rolls": 0.4, "left": 0.5, "tailgates": 0.5}},
            {"type": "nemesis", "name": "nemesis"},
        ],
        "number_goals_bounds": [2, 3], "duration_bounds": [12, 12], **more,
    }  # fmt: skip
    return load_config(document)


def _plain(found: Score) -> Mapping[str, Any]:
    hidden = ("time_to_begin_s", "record", "controller", "ran")
    return {name: value for name, value in found.to_json().items() if name not in hidden}


def test_a_batch_equals_its_trials_one_by_one_and_their_records(tmp_path: Path) -> None:
    config = _configured()
    batches = [run_batch(config, "rules", seed=SEED, batch=batch).outcomes for batch in (1, 3)]
    for alone, own in zip(*batches, strict=True):
        record = tmp_path / f"{own.instance.trial}.mcap"
        single = run_trial(draw(config, SEED, own.instance.trial), "rules", record=record)
        assert not own.instance.problem.network.is_straight
        assert _plain(own.score) == _plain(alone.score) == _plain(single.score)
        assert _plain(score(read(record))) == _plain(single.score)


@pytest.mark.parametrize("network", [RING, SNAKE])
def test_a_rigid_motion_of_the_map_commutes_with_a_trial(network: Any, tmp_path: Path) -> None:
    tx, ty, theta = network.transform
    turn = cmath.rect(1.0, TURN)
    place = turn * complex(tx, ty) + SHIFT
    moved = replace(network, transform=(place.real, place.imag, theta + TURN))
    config = _configured(network=None, rnd=network.to_document())
    here = draw(config, SEED, 0)
    starts = [_moved(pose, turn) for pose in here.starts]
    discs: list[DiscObstacle] = []
    for s in np.flatnonzero(network.bent).tolist():
        spot, way = Track(network, s).point(0.4 * float(network.lengths[s]))
        spot -= 0.35j * way
        discs.append(DiscObstacle(spot.real, spot.imag, 0.1))
    away = [turn * complex(disc.x, disc.y) + SHIFT for disc in discs]
    beside = tuple(DiscObstacle(spot.real, spot.imag, 0.1) for spot in away)
    here = replace(here, problem=replace(here.problem, obstacles=tuple(discs)))
    there = replace(here, problem=replace(here.problem, network=moved, obstacles=beside), starts=tuple(starts))
    frames: list[Frames] = []
    verdicts: list[Any] = []
    for k, found in enumerate((here, there)):
        record = tmp_path / f"{k}.mcap"
        verdicts.append(run_trial(found, "rules", record=record).score.verdict)
        frames.append(read(record).frames)
    spots = turn * (frames[0].x + 1j * frames[0].y) + SHIFT
    assert np.abs(spots - (frames[1].x + 1j * frames[1].y)).max() < 1e-6
    assert (frames[0].bits == frames[1].bits).all()
    assert (frames[0].lane == frames[1].lane).all()
    assert [one.rule for one in verdicts[0].violations] == [one.rule for one in verdicts[1].violations]


def _moved(pose: Pose, turn: complex) -> Pose:
    spot, way = turn * complex(pose.x, pose.y) + SHIFT, turn * complex(pose.c, pose.s)
    return Pose(spot.real, spot.imag, way.real, way.imag)


def test_the_referee_agrees_with_the_slow_judge() -> None:
    seen = sum((compare(number, BENT) for number in range(8)), start=compare(8, BENT))
    assert set(seen) >= set(EXPECTED)


def test_an_obstacle_beyond_what_is_looked_at_does_not_lie_before_the_disc() -> None:
    """Trial 480: the reference once took an empty stretch of a lane for one that a disc may lie in."""
    assert compare(480, BENT)["E5"] > 0
