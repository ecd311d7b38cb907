"""E-agents of 2016 and their like on roads that bend: `wander`, `loop`, `follow` and `parked`."""

from __future__ import annotations

import cmath
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.kernels.compile import jit
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.packing import pack
from dubins_traffic.routing.lane_graph import place_on_lane
from dubins_traffic.runs.single import run_trial
from dubins_traffic.runs.sources import load_record
from tests.chain_reference import RING, SNAKE, Track

W = 0.3
RIGHT = 0.7 * 2.0 * W
"""So far right of the centre line these cars drive."""


def _instance(network: Any, kinds: list[dict[str, Any]], duration: float, trial: int = 0, **more: Any) -> Instance:
    config = load_config(
        {
            "version": 1, "problem_domain": "dubins_traffic", "rnd": network.to_document(), "duration": duration,
            "number_goals_bounds": [2, 2], "e-agents": kinds, **more,
        }
    )  # fmt: skip
    return draw(config, 21, trial)


def _driven(instance: Instance, folder: Path, controller: str = "simple") -> Frames:
    record = folder / "trial.mcap"
    run_trial(instance, controller, record=record, overwrite=True)
    return load_record(record).frames


def _off(frames: Frames, n: int, tracks: list[Track]) -> Any:
    """Return (segment, metres along, metres left, direction) of a car in each frame."""
    found: list[tuple[int, float, float, complex]] = []
    for x, y, s in zip(frames.x[:, n], frames.y[:, n], frames.segment[:, n].tolist(), strict=True):
        foot = tracks[s].foot(float(x), float(y))
        found.append((s, foot.along, foot.left, foot.way))
    return found


@jit
def _places(t, lane, along, out):
    for k in range(len(along)):
        out[k] = place_on_lane(t, 0, lane, along[k])


@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_places_along_a_bend_are_those_of_the_network(network: Any) -> None:
    table = pack([network], [2.0 * W])
    for lane in range(network.lanes):
        length = float(network.lengths[lane >> 1])
        along = np.linspace(0.0, length, 101)
        out = np.empty((len(along), 4))
        _places(table, lane, along, out)
        place, way = network.lane_places(lane, along)
        assert np.abs(out[:, :2] - place).max() < 1e-12
        assert np.abs(out[:, 2:] - way).max() < 1e-12


@pytest.mark.parametrize("car", [{}, {"bounds": {"turning_radius": 0.3}}], ids=["pivots", "curves"])
@pytest.mark.parametrize("kind", ["wander", "loop"])
@pytest.mark.parametrize("network", [RING, SNAKE], ids=["ring", "snake"])
def test_they_drive_round_curves_on_their_side_of_the_road(
    network: Any, kind: str, car: dict[str, Any], tmp_path: Path
) -> None:
    tracks = [Track(network, s) for s in range(len(network.segments))]
    on_curves, worst = 0, 0.0
    for trial in range(2):
        agents = [{"type": kind, "name": "car", "parameters": {"speed": 0.6}}]
        frames = _driven(_instance(network, agents, 90.0, trial, **({"car": car} if car else {})), tmp_path)
        for k, (s, along, left, way) in enumerate(_off(frames, 1, tracks)):
            ahead = (way.conjugate() * complex(frames.c[k, 1], frames.s[k, 1])).real
            if network.bent[s] and 2.4 < along < tracks[s].length - 2.4 and abs(ahead) > 0.9:
                on_curves += 1
                worst = max(worst, abs(left * ahead / abs(ahead) + RIGHT))
    assert on_curves > 200
    assert worst < 0.12


def test_who_parks_in_a_bend_drives_off_along_it(tmp_path: Path) -> None:
    tracks = [Track(RING, s) for s in range(len(RING.segments))]
    place, way = tracks[4].point(4.0)
    place -= 1j * RIGHT * way
    found = _instance(RING, [{"type": "parked", "name": "car", "parameters": {"vacates_after": 2.0}}], 20.0)
    found = replace(found, starts=(found.starts[0], Pose(place.real, place.imag, way.real, way.imag)))
    frames = _driven(found, tmp_path, "lanes")
    seen = _off(frames, 1, tracks)
    assert seen[50][1] == pytest.approx(4.0)
    on_road = [(along, left) for s, along, left, _ in seen if s == 4 and along < tracks[4].length - 1.5]
    assert max(along for along, _ in on_road) > 7.0
    assert max(abs(left + RIGHT) for _, left in on_road) < 0.12


def test_who_follows_comes_after_the_ego_round_curves(tmp_path: Path) -> None:
    tracks = [Track(RING, s) for s in range(len(RING.segments))]
    starts: list[Pose] = []
    for along in (2.6, 1.4):
        place, way = tracks[4].point(along)
        place -= 1j * W * way
        starts.append(Pose(place.real, place.imag, way.real, way.imag))
    found = replace(
        _instance(RING, [{"type": "follow", "name": "car", "parameters": {"speed": 0.7}}], 40.0),
        starts=tuple(starts),
    )
    frames = _driven(found, tmp_path, "lanes")
    apart = np.hypot(frames.x[:, 0] - frames.x[:, 1], frames.y[:, 0] - frames.y[:, 1])
    assert float(np.hypot(*(np.ptp(axis[:, 1]) for axis in (frames.x, frames.y)))) > 4.0
    assert float(apart.max()) < 3.0
    spots = frames.x[:, 0] + 1j * frames.y[:, 0]
    follows = (frames.x[:, 1] + 1j * frames.y[:, 1])[60:]
    assert max(float(np.abs(spots - one).min()) for one in follows) < 0.3


@pytest.mark.parametrize("kind", ["wander", "loop", "follow"])
def test_a_rigid_motion_of_the_map_commutes_with_them(kind: str, tmp_path: Path) -> None:
    angle, shift = 1.3, complex(11.0, -7.0)
    turn = cmath.rect(1.0, angle)
    tx, ty, theta = RING.transform
    origin = turn * complex(tx, ty) + shift
    moved = replace(RING, transform=(origin.real, origin.imag, theta + angle))
    here = _instance(RING, [{"type": kind, "name": "car", "count": 2}], 15.0)
    starts: list[Pose] = []
    for pose in here.starts:
        spot, way = turn * complex(pose.x, pose.y) + shift, turn * complex(pose.c, pose.s)
        starts.append(Pose(spot.real, spot.imag, way.real, way.imag))
    there = replace(here, problem=replace(here.problem, network=moved), starts=tuple(starts))
    one, other = (_driven(own, tmp_path, "rules") for own in (here, there))
    assert np.abs(turn * (one.x + 1j * one.y) + shift - (other.x + 1j * other.y)).max() < 1e-6
    assert (one.lane == other.lane).all()
