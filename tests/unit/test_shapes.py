"""One list of shapes: SVG, Matplotlib and pixels show all of it, and the replay page takes its colours and widths."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from dubins_traffic.animation.canvas import Canvas
from dubins_traffic.animation.raster import Raster
from dubins_traffic.animation.raster_ground import rgb
from dubins_traffic.cars.state import Pose
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer import palette, shapes, svg
from dubins_traffic.viewer.marks import Mark
from dubins_traffic.viewer.replay import replay_page
from dubins_traffic.viewer.shapes import Circle, Line, Region, Shape, Sign, Text, Width
from tests.synthetic import driven, instance, obstacles_beside

GRID = RoadNetwork.grid(3, 4)


@pytest.fixture(scope="module")
def tried() -> Instance:
    return instance(GRID, cars=3, seconds=2.0, obstacles=obstacles_beside(GRID))


def everything(tried: Instance) -> list[Shape]:
    problem = tried.problem
    marks = [Mark(0.0, kind, "", car, (1.0, 1.0)) for kind, car in (("contact", 0), ("breach", 0), ("breach", 1))]
    return [
        *shapes.roads(GRID, problem.car),
        *shapes.hints(GRID, problem.car),
        *shapes.centres(GRID, problem.car),
        *shapes.goals(problem),
        *shapes.obstacles(problem),
        *shapes.ways([np.array([[0.0, 0.0], [1.0, 1.0]])]),
        *shapes.cars(problem.car.body, tried.names, tried.starts),
        *shapes.goal_names(problem, Width(0.0, 11.0, 11.0)),
        *shapes.signs(marks),
    ]


def test_widths_are_metres_within_bounds_and_rims_are_added() -> None:
    assert Width(0.5).at(20.0) == 10.0
    assert Width(0.5, most=4.0).at(20.0) == 4.0
    assert Width(0.045, 0.8).at(1.0) == 0.8
    assert Width(1.2, rim=0.06, least_rim=1.6).at(10.0) == pytest.approx(13.6)
    small, large = (Text(0.0, 0.0, "x", "#000000", Width(0.5, 6.0, 14.0)).size_at(scale) for scale in (10.0, 90.0))
    assert (small, large) == (0.0, 14.0)
    line = Line(np.zeros((2, 2)), "#000000", Width(1.0), opacity=0.8, fades=20.0)
    assert (line.opacity_at(10.0), line.opacity_at(40.0)) == (0.4, 0.8)


def test_svg_has_an_element_for_each_shape(tried: Instance) -> None:
    drawing = svg.Drawing(GRID, tried.problem.car)
    drawing.parts.clear()
    every = everything(tried)
    drawing.draw(every)
    assert len(drawing.parts) == len(every)
    tags = {Line: "polyline", Region: "polygon", Circle: "circle", Text: "text"}
    for shape, part in zip(every, drawing.parts, strict=True):
        if not isinstance(shape, Sign):
            assert part.startswith(f"<{tags[type(shape)]} "), part
            colour = shape.fill if isinstance(shape, Region | Circle) else shape.colour
            assert f'"{colour}"' in part


def test_matplotlib_draws_every_colour_and_returns_what_a_legend_shows(tried: Instance) -> None:
    pytest.importorskip("matplotlib")
    canvas = Canvas(GRID, tried.problem.car, ())
    shown = canvas.draw(everything(tried))
    assert [*shown] == [
        "goal",
        "obstacle",
        *reversed(tried.names),
        "contact",
        "breach of the ego",
        "breach of others",
    ]
    orders = [artist.get_zorder() for artist in (*canvas.axes.collections, *canvas.axes.patches)]
    assert len(set(orders)) > 5
    assert len(canvas.axes.patches) == sum(isinstance(shape, Region | Circle) for shape in everything(tried))


def test_pixels_show_roads_goals_and_obstacles_of_the_list(tried: Instance) -> None:
    raster = Raster(tried.problem, width=700, height=600)
    picture = raster.ground()
    obstacle = next(one for one in shapes.obstacles(tried.problem) if isinstance(one, Circle))
    column, row = raster.at(obstacle.x, obstacle.y)
    assert picture[int(row), int(column)].tolist() == rgb(obstacle.fill).tolist()
    ways = shapes.stops(tried.problem) + shapes.centres(GRID, tried.problem.car)
    middle = next(line for line in ways if isinstance(line, Line) and line.dash is not None)
    assert middle.colour == palette.LINE_COLOUR


def test_the_ego_is_last_and_on_top(tried: Instance) -> None:
    bodies = shapes.cars(tried.problem.car.body, tried.names, tried.starts)[::2]
    assert [body.label for body in bodies if isinstance(body, Region)] == [*reversed(tried.names)]
    ghosts = shapes.cars(tried.problem.car.body, ["ego"], [Pose(0.0, 0.0, 1.0, 0.0)], ghost=True)
    assert isinstance(ghosts[0], Region)
    assert (ghosts[0].fill, ghosts[0].edge, ghosts[0].label) == ("#ffffff", palette.EGO_COLOUR, None)


def test_the_replay_page_has_colours_and_widths_of_the_same_place(tried: Instance) -> None:
    own, frames = driven(tried)
    page = replay_page(own, frames, None)
    for name, (light, dark) in palette.MAP.items():
        assert re.findall(rf"--{name}:(#[0-9a-f]{{6}})[;}}]", page) == [light.lower(), dark.lower()]
    found = re.search(r"const LOOKS = (.*?);", page)
    assert found is not None
    assert json.loads(found[1]) == {
        "kerb": [shapes.KERB, shapes.KERB_PIXELS],
        "centre": [shapes.CENTRE.metres, shapes.CENTRE.least],
        "hint": [shapes.HINT.metres, shapes.HINT.least],
        "dash": [*shapes.DASH],
    }
