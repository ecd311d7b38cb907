"""Frames of a trial as arrays of pixels, thousands a second: the roads are drawn once, the cars in a kernel.

They look like the replay page: the same colours, the same marks, the same goals, lit where they have been visited.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Final

import numpy as np

from dubins_traffic.animation.raster_ground import Cover, blend, rgb
from dubins_traffic.animation.raster_kernel import MARK, Image, View, paint
from dubins_traffic.cars.body import Disc
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.calls import bound
from dubins_traffic.viewer import palette, shapes
from dubins_traffic.viewer.marks import goal_numbers
from dubins_traffic.viewer.scene import Extent, extent, obstacle_points
from dubins_traffic.viewer.shapes import Circle, Line, Region, Shape, Text

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Problem

SIZES: Final = (16, 4096)
"""Fewest and most pixels of a side."""
MARGIN: Final = 0.3
"""Metres around the roads."""
COLOURS: Final = (
    palette.INK_COLOUR,
    "#FFFFFF",
    palette.EGO_COLOUR,
    palette.CONTACT_COLOUR,
    *palette.BREACH_COLOURS,
    *(palette.car_colour(car) for car in range(1 + len(palette.AGENT_COLOURS))),
)
"""Of what the kernel paints, in its order."""
MOST_GROUNDS: Final = 64
"""Pictures of the roads, with other goals lit, that are kept."""
NO_MARKS: Final = np.zeros((0, MARK))


class Raster:
    """Draws frames of the trials of one problem as arrays of pixels.

    Parameters
    ----------
    problem : Problem
        Whose roads, goals, obstacles and cars are drawn.
    width, height : int
        Pixels of a frame.
    chosen : int
        Number of the car that has a ring about it; -1 for none.

    Raises
    ------
    InputError
        If a side has fewer or more pixels than `SIZES`.

    Examples
    --------
    >>> raster = Raster(problem, width=400, height=400)                 # doctest: +SKIP
    >>> picture = raster.frame(state.x[0], state.y[0], state.c[0], state.s[0])      # doctest: +SKIP
    """

    def __init__(self, problem: Problem, *, width: int = 400, height: int = 400, chosen: int = 0) -> None:
        for name, side in (("width", width), ("height", height)):
            if not SIZES[0] <= side <= SIZES[1]:
                raise InputError(
                    "not a size of pictures",
                    field=name,
                    value=side,
                    expected=f"{SIZES[0]} to {SIZES[1]} pixels",
                )
        self.width, self.height = width, height
        self._problem = problem
        self._view = _view(problem, width, height, chosen)
        self._numbers = goal_numbers(problem)
        self._base = self._roads()
        self._grounds: dict[tuple[int, ...], Image] = {}
        self._paint = bound(paint)

    def frame(
        self,
        x: Floats,
        y: Floats,
        c: Floats,
        s: Floats,
        *,
        lit: Sequence[int] = (),
        marks: Floats = NO_MARKS,
        out: Image | None = None,
    ) -> Image:
        """Return the picture of a frame, (H, W, 3) uint8; equal frames give equal bytes.

        Parameters
        ----------
        x, y, c, s : (N,)
            Poses of the cars, the ego first: metres, and cosines and sines of their headings, world frame.
        lit : sequence of int
            Intersections of the goals that the ego has visited in this round.
        marks : (M, 4)
            Contacts and breaches so far, each x and y, metres, its kind (`raster_kernel.MARKS`) and
            its age, seconds.
        out : (H, W, 3) uint8
            Where the picture is written, if it need not be a new array.
        """
        ground = self.ground(lit)
        if out is None:
            out = ground.copy()
        else:
            out[...] = ground
        self._paint(out, x, y, c, s, marks, self._view)
        return out

    def ground(self, lit: Sequence[int] = ()) -> Image:
        """Return the picture without cars, in which these goals are lit; it must not be written to."""
        key = tuple(vertex for vertex in self._numbers if vertex in lit)
        kept = self._grounds.get(key)
        if kept is None:
            if len(self._grounds) >= MOST_GROUNDS:
                self._grounds.clear()
            kept = self._grounds[key] = self._with_goals(key)
        return kept

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Return where a point of the world, metres, lies in the picture: pixels from the left, and from above."""
        view = self._view
        return (x - view.left) * view.scale, (view.top - y) * view.scale

    def _roads(self) -> Image:
        """Return roads with kerbs, centre lines, directions of lanes and stop lines."""
        problem = self._problem
        network, car = problem.network, problem.car
        picture = np.broadcast_to(rgb(palette.GROUND_COLOUR), (self.height, self.width, 3)).copy()
        drawn = [*shapes.roads(network, car), *shapes.hints(network, car), *shapes.centres(network, car)]
        self._draw(picture, [*drawn, *shapes.stops(problem)])
        return (picture + 0.5).astype(np.uint8)

    def _with_goals(self, lit: Sequence[int]) -> Image:
        """Return the roads with goals, those of some intersections lit, and obstacles."""
        picture = self._base.astype(np.float64)
        problem = self._problem
        size = shapes.Width(0.5 * problem.intersection_radius, 6.0, 14.0)
        names = shapes.goal_names(problem, size)
        self._draw(picture, [*shapes.goals(problem, lit), *names, *shapes.obstacles(problem)])
        return (picture + 0.5).astype(np.uint8)

    def _draw(self, picture: Floats, drawn: Sequence[Shape]) -> None:
        """Draw shapes; lines of one colour that follow each other cover each other as one shape."""
        scale = self._view.scale
        for (kind, colour, opacity), run in groupby(drawn, key=lambda shape: _look(shape, scale)):
            if kind is Line:
                cover = Cover(self.width, self.height)
                for shape in run:
                    if isinstance(shape, Line):
                        self._line(cover, shape)
                blend(picture, cover, colour, opacity)
                continue
            for shape in run:
                for part, ink, share in self._covers(shape):
                    blend(picture, part, ink, share)

    def _line(self, cover: Cover, line: Line) -> None:
        half, points = 0.5 * line.width.at(self._view.scale), [self.at(*point) for point in line.points]
        if line.round:
            cover.path(points, half)
        else:
            on, off = line.dash or (np.inf, 1.0)
            on = min(on, float(np.abs(line.points[1:] - line.points[:-1]).sum()) + 1.0)
            cover.dashed(points, half, on * self._view.scale, off * self._view.scale)

    def _covers(self, shape: Shape) -> Iterator[tuple[Cover, str, float]]:
        """Return what the parts of a shape cover, with their colours and opacities."""
        scale, stroke = self._view.scale, self._view.stroke
        if isinstance(shape, Circle):
            inner, ring = self._cover(), self._cover()
            x, y = self.at(shape.x, shape.y)
            inner.disc(x, y, shape.radius * scale)
            ring.ring(x, y, shape.radius * scale, 0.5 * shape.width * stroke, shape.dash)
            yield inner, shape.fill, shape.opacity
            yield ring, shape.edge, 1.0
        elif isinstance(shape, Region):
            points = [self.at(*point) for point in shape.points]
            for colour, wide in ((shape.edge, 0.5 * shape.width), (shape.fill, -0.5 * shape.width)):
                if colour is not None:
                    cover = self._cover()
                    cover.polygon(points, wide)
                    yield cover, colour, 1.0
        elif isinstance(shape, Text) and shape.number is not None and (size := shape.size_at(scale)) > 0.0:
            for colour, half in (("#FFFFFF", 0.09 * size + 1.3), (shape.colour, 0.09 * size)):
                cover = self._cover()
                cover.digits(shape.number, *self.at(shape.x, shape.y), size, half)
                yield cover, colour, 1.0

    def _cover(self) -> Cover:
        return Cover(self.width, self.height)


def _look(shape: Shape, scale: float) -> tuple[type[Shape], str, float]:
    """Return what tells shapes apart that are not drawn as one: their kind, and of lines colour and opacity."""
    if isinstance(shape, Line):
        return Line, shape.colour, shape.opacity_at(scale)
    return type(shape), "", 1.0


def picture_size(problem: Problem, longer: int) -> tuple[int, int]:
    """Return width and height of a picture that all roads fill, the longer side `longer` pixels; both are even."""
    box = _box(problem)
    width, height = box.width + 2.0 * MARGIN, box.height + 2.0 * MARGIN
    sides = (max(SIZES[0], 2 * round(0.5 * longer * side / max(width, height))) for side in (width, height))
    across, down = sides
    return across, down


def _box(problem: Problem) -> Extent:
    """Return the box of all roads, goals and obstacles of a problem."""
    reach = problem.intersection_radius
    goals = problem.network.points[list(problem.goal_vertices)].reshape(-1, 2)
    fixed = [goals - reach, goals + reach, *(obstacle_points(one) for one in problem.obstacles)]
    return extent(problem.network, 0.5 * problem.car.road_width, *fixed)


def _view(problem: Problem, width: int, height: int, chosen: int) -> View:
    """Return how all roads, goals and obstacles of a problem just fit into a picture."""
    body, box = problem.car.body, _box(problem)
    scale = min(width / (box.width + 2.0 * MARGIN), height / (box.height + 2.0 * MARGIN))
    side = float(min(width, height))
    grow = max(1.0, min(5.0, 0.0125 * side) / (body.reach * scale))
    size = grow * scale
    disc = isinstance(body, Disc)
    return View(
        scale=scale,
        left=0.5 * (box.left + box.right) - 0.5 * width / scale,
        top=0.5 * (box.bottom + box.top) + 0.5 * height / scale,
        half_length=0.0 if disc else 0.5 * body.length * size,
        half_width=0.0 if disc else 0.5 * body.width * size,
        rounding=body.reach * size if disc else 0.0,
        edge=min(0.6, 0.08 * body.reach * size),
        mark=max(0.42 * problem.car.w * scale, min(6.5, 0.016 * side)),
        stroke=min(1.0, side / 300.0),
        chosen=chosen,
        colour=np.stack([rgb(colour) for colour in COLOURS]),
    )
