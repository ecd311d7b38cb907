"""Frames as pixels: what is where, in which colours, and that equal frames give equal bytes."""

from __future__ import annotations

import os
import subprocess
import sys
from io import BytesIO
from itertools import pairwise

import numpy as np
import pytest
from PIL import Image as Pictures

from dubins_traffic.animation.live import png
from dubins_traffic.animation.raster import Raster
from dubins_traffic.animation.raster_ground import rgb
from dubins_traffic.animation.raster_kernel import MARKS, Image
from dubins_traffic.cars.body import PolygonObstacle
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.shapes import stop_lines
from tests.synthetic import instance, obstacles_beside

GRID = RoadNetwork.grid(3, 4)


@pytest.fixture(scope="module")
def trial() -> Instance:
    return instance(GRID, cars=9, seconds=5.0, obstacles=obstacles_beside(GRID))


def columns(poses: object) -> list[Floats]:
    return [np.ascontiguousarray(column) for column in np.array(poses, dtype=np.float64).T]


def pixel(raster: Raster, picture: Image, x: float, y: float) -> list[int]:
    column, row = raster.at(x, y)
    return picture[int(row), int(column)].tolist()


def colour(text: str) -> list[int]:
    return rgb(text).astype(int).tolist()


def test_every_car_stands_in_its_colour_where_it_is(trial: Instance) -> None:
    raster = Raster(trial.problem, width=900, height=700)
    spread = [(0.6 + 1.2 * (k % 3), 0.7 + 2.0 * (k // 3), np.cos(0.7 * k), np.sin(0.7 * k)) for k in range(9)]
    picture = raster.frame(*columns(spread))
    reach = trial.problem.car.body.reach
    for car, (x, y, c, s) in enumerate(spread):
        behind = pixel(raster, picture, x - 0.4 * reach * c, y - 0.4 * reach * s)
        ahead = pixel(raster, picture, x + 0.4 * reach * c, y + 0.4 * reach * s)
        assert behind == colour(palette.car_colour(car)), car
        assert ahead == [255, 255, 255], car


def test_the_ego_is_on_top_and_has_a_ring_about_it(trial: Instance) -> None:
    place = [(0.5, 0.3, 1.0, 0.0)]
    raster, bare = (Raster(trial.problem, chosen=chosen) for chosen in (0, -1))
    alone = bare.frame(*columns(place))
    piled = bare.frame(*columns(place * 3))
    assert pixel(bare, piled, 0.42, 0.3) == pixel(bare, alone, 0.42, 0.3) == colour(palette.EGO_COLOUR)
    ringed = raster.frame(*columns(place))
    changed = np.argwhere((ringed != alone).any(axis=2)) + 0.5
    column, row = raster.at(0.5, 0.3)
    away = np.hypot(changed[:, 0] - row, changed[:, 1] - column)
    assert len(changed) > 30
    assert away.max() - away.min() < 4.0
    assert [0, 114, 178] in ringed.reshape(-1, 3).tolist()


def test_roads_ground_goals_and_obstacles_have_their_colours(trial: Instance) -> None:
    problem = trial.problem
    raster = Raster(problem, width=800, height=800)
    picture = raster.frame(*columns(np.zeros((0, 4))))
    assert picture.shape == (800, 800, 3)
    assert picture.dtype == np.uint8
    ends = problem.network.points[problem.network.ends[0]]
    quarter = ends[0] + 0.3 * (ends[1] - ends[0])
    tangent = problem.network.tangents[0]
    left = quarter + 0.45 * np.array([-tangent[1], tangent[0]])
    assert pixel(raster, picture, *left) == colour(palette.ROAD_COLOUR)
    assert picture[2, 2].tolist() == colour(palette.GROUND_COLOUR)
    for obstacle in problem.obstacles:
        inside = (
            np.add(obstacle.vertices[0], (0.1, 0.25))
            if isinstance(obstacle, PolygonObstacle)
            else (obstacle.x, obstacle.y)
        )
        assert pixel(raster, picture, *inside) == colour(palette.OBSTACLE_COLOUR)
    goal = problem.goal_vertices[0]
    x, y = problem.network.points[goal]
    spot = (x + 0.7 * problem.intersection_radius, y + 0.05)
    lit = raster.frame(*columns(np.zeros((0, 4))), lit=[goal])
    green = np.array([colour(palette.GOAL_COLOUR)] * 3)
    seen = np.array([colour(palette.ROAD_COLOUR), pixel(raster, picture, *spot), pixel(raster, lit, *spot)])
    greyer = np.abs(seen - green).sum(axis=1).tolist()
    assert all(first > second for first, second in pairwise(greyer)), seen
    assert (raster.frame(*columns(np.zeros((0, 4)))) == picture).all(), "a frame has changed the roads"


def test_cars_stop_at_lines_before_crossings_only() -> None:
    problem = draw(load_config("town"), seed=1, trial=0).problem
    lines = stop_lines(problem)
    network = problem.network
    arms = [vertex for vertex in network.ends.ravel().tolist() if network.degrees[vertex] >= 3]
    assert len(lines) == len(arms) > 0
    raster = Raster(problem, width=1000, height=1000)
    picture = raster.ground()
    seen = [pixel(raster, picture, *(0.5 * (first + last))) for first, last in lines]
    assert seen.count([255, 255, 255]) >= len(lines) - 4 * len(problem.goals)


def test_rectangles_are_turned_as_they_head() -> None:
    one = instance(GRID, cars=1, seconds=1.0, rectangles=True)
    raster = Raster(one.problem, width=1200, height=900, chosen=-1)
    x, y = 2.2, 1.1
    for c, s in ((1.0, 0.0), (0.6, 0.8), (0.0, 1.0)):
        picture = raster.frame(*columns([(x, y, c, s)]))
        blue, road = colour(palette.EGO_COLOUR), raster.ground()
        assert pixel(raster, picture, x - 0.2 * c, y - 0.2 * s) == blue
        for u, v in ((-0.2, 0.16), (-0.2, -0.16), (0.28, 0.0)):
            place = (x + u * c - v * s, y + u * s + v * c)
            assert pixel(raster, picture, *place) == pixel(raster, road, *place)


def test_marks_have_their_colours_and_rings_fade(trial: Instance) -> None:
    raster = Raster(trial.problem, width=800, height=800)
    nobody = columns(np.zeros((0, 4)))
    inks = (palette.CONTACT_COLOUR, palette.BREACH_COLOURS[0], "#FFFFFF")
    for kind, ink in zip((MARKS.CONTACT, MARKS.OWN, MARKS.OTHERS), inks, strict=True):
        young, old = (raster.frame(*nobody, marks=np.array([[2.2, 1.1, float(kind), age]])) for age in (0.3, 9.0))
        assert pixel(raster, old, 2.2, 1.1) == colour(ink)
        ground = raster.ground()
        assert (young != ground).sum() > (old != ground).sum() > 0


def test_equal_frames_give_equal_bytes_interpreted_too(trial: Instance) -> None:
    script = (
        "import sys, numpy as np, hashlib; from dubins_traffic.animation.raster import Raster\n"
        "from dubins_traffic.problem.configuration import load_config\n"
        "from dubins_traffic.problem.draw import draw\n"
        "one = draw(load_config('town'), seed=3, trial=1)\n"
        "poses = [np.ascontiguousarray(part) for part in np.array(one.starts).T]\n"
        "marks = np.array([[1.0, 1.0, 0.0, 0.4], [2.0, 1.5, 1.0, 0.1], [0.5, 2.5, 2.0, 3.0]])\n"
        "print(hashlib.sha256(Raster(one.problem, width=240, height=180).frame(*poses, marks=marks)).hexdigest())"
    )
    hashes = {
        subprocess.run(
            [sys.executable, "-c", script],
            env={**os.environ, **more},
            check=True,
            capture_output=True,
            text=True,
        ).stdout
        for more in ({"DUBINS_TRAFFIC_KERNELS": "compiled"}, {"NUMBA_DISABLE_JIT": "1"})
    }
    assert len(hashes) == 1
    raster, poses = Raster(trial.problem), columns(trial.starts)
    first = raster.frame(*poses)
    room = np.empty_like(first)
    assert raster.frame(*poses, out=room) is room
    assert (room == first).all()
    assert first is not raster.frame(*poses)


@pytest.mark.parametrize(("width", "height"), [(16, 16), (64, 900), (1500, 40)])
def test_all_sizes_hold_the_roads(trial: Instance, width: int, height: int) -> None:
    raster = Raster(trial.problem, width=width, height=height)
    picture = raster.frame(*columns(trial.starts))
    assert picture.shape == (height, width, 3)
    for x, y in trial.problem.network.points:
        column, row = raster.at(x, y)
        assert 0 <= column < width
        assert 0 <= row < height


def test_no_picture_is_smaller_or_larger_than_makes_sense(trial: Instance) -> None:
    with pytest.raises(InputError, match=r"width: not a size of pictures: got 4; expected 16 to 4096 pixels"):
        Raster(trial.problem, width=4)
    with pytest.raises(InputError, match=r"height.*expected 16 to 4096"):
        Raster(trial.problem, height=5000)


def test_png_files_hold_the_picture(trial: Instance) -> None:
    picture = Raster(trial.problem, width=300, height=200).frame(*columns(trial.starts))
    assert (np.asarray(Pictures.open(BytesIO(png(picture)))) == picture).all()
