"""Pictures for video, 400 by 400 pixels, of eight cars in the town: ours, and the same scene drawn with Matplotlib.

And a GIF of a minute of the town: its size, and its time beside Pillow's for the same pictures.

Both take turns on one core. Matplotlib's canvas keeps the roads, as an animation does (`blit`), and draws the cars and
their arrow heads only.
"""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time
from typing import Any

import numpy as np

from benchmarks.table import Row
from dubins_traffic.animation.canvas import Canvas
from dubins_traffic.animation.raster import Raster
from dubins_traffic.cars.state import Pose
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Problem
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.shapes import nose, outline

SIDE, CARS, FRAMES, PLOTTED, ROUNDS = 400, 8, 2000, 20, 5
LEAST, TIMES = 2000.0, 10.0
MINUTE, LARGEST, SLOWEST = 60.0, 2e6, 2.0
"""Seconds of the GIF, most bytes of it, and how often Pillow's time it may take."""


def measure() -> list[Row]:
    """Return the rows of this benchmark; the best turn of each counts."""
    problem = draw(load_config("town"), seed=1, trial=0).problem
    rng = np.random.default_rng(1)
    low, high = problem.network.points.min(axis=0), problem.network.points.max(axis=0)
    places, angles = rng.uniform(low, high, (FRAMES, CARS, 2)), rng.uniform(0.0, 6.28, (FRAMES, CARS))
    columns = [np.ascontiguousarray(part) for part in (*np.moveaxis(places, 2, 0), np.cos(angles), np.sin(angles))]
    raster = Raster(problem, width=SIDE, height=SIDE)
    raster.frame(*(column[0] for column in columns))
    plot = _Plotted(problem)
    ours = theirs = 0.0
    for _ in range(ROUNDS):
        begun = process_time()
        for frame in range(FRAMES):
            raster.frame(*(column[frame] for column in columns))
        ours = max(ours, FRAMES / (process_time() - begun))
        begun = process_time()
        for frame in range(PLOTTED):
            plot.frame([Pose(*(float(column[frame, car]) for column in columns)) for car in range(CARS)])
        theirs = max(theirs, PLOTTED / (process_time() - begun))
    ratio = ours / theirs
    return [
        Row("frames of 400 x 400 pixels", f"{ours:,.0f} a second", f">= {LEAST:,.0f}", ours >= LEAST),
        Row(
            "... beside Matplotlib",
            f"{ratio:,.0f} times its {theirs:,.0f} a second",
            f">= {TIMES:.0f} times",
            ratio >= TIMES,
        ),
        *_minute(),
    ]


def _minute() -> list[Row]:
    """Return the rows of a GIF of a minute; Pillow is given the same pictures, and ours is timed with painting them."""
    from PIL import Image

    from dubins_traffic.animation.animate import FPS, animate
    from dubins_traffic.record.reader import read
    from dubins_traffic.runs.single import run_trial

    with TemporaryDirectory() as folder:
        record, ours, theirs = (Path(folder) / name for name in ("trial.mcap", "ours.gif", "theirs.gif"))
        run_trial(draw(load_config("town"), seed=1, trial=0), "rules", record=record)
        animation = animate(read(record), stop=MINUTE)
        pictures = [Image.fromarray(image) for image in animation]
        begun = process_time()
        animation.write(ours)
        own = process_time() - begun
        begun = process_time()
        pictures[0].save(theirs, save_all=True, append_images=pictures[1:], duration=1000 / FPS, loop=0)
        pillow = process_time() - begun
        size = ours.stat().st_size
    return [
        Row("a GIF of a minute", f"{size / 1e6:.2f} MB", f"<= {LARGEST / 1e6:.0f} MB", size <= LARGEST),
        Row(
            "... beside Pillow",
            f"{own / pillow:.2f} times its {pillow:.1f} s",
            f"<= {SLOWEST:.0f} times",
            own <= SLOWEST * pillow,
        ),
    ]


class _Plotted:
    """The same scene on a canvas of Matplotlib that keeps the roads."""

    def __init__(self, problem: Problem) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        self._body = problem.car.body
        canvas = Canvas(problem.network, problem.car, ())
        canvas.roads()
        canvas.problem(problem)
        canvas.finish("")
        canvas.figure.set_size_inches(4.0, 4.0)
        canvas.axes.set_position((0.0, 0.0, 1.0, 1.0))
        canvas.figure.set_dpi(100)
        self._axes = canvas.axes
        self._agg: Any = FigureCanvasAgg(canvas.figure)
        self._shapes: list[tuple[Any, Any]] = []
        zero = Pose(0.0, 0.0, 1.0, 0.0)
        for car in range(CARS):
            (body,) = self._axes.fill(*outline(self._body, zero).T, color=palette.car_colour(car), animated=True)
            (tip,) = self._axes.fill(*nose(self._body, zero).T, color="white", animated=True)
            self._shapes.append((body, tip))
        self._agg.draw()
        self._ground = self._agg.copy_from_bbox(canvas.figure.bbox)

    def frame(self, poses: list[Pose]) -> np.ndarray:
        """Return the picture of a frame."""
        self._agg.restore_region(self._ground)
        for (body, tip), pose in zip(self._shapes, poses, strict=True):
            body.set_xy(outline(self._body, pose))
            tip.set_xy(nose(self._body, pose))
            self._axes.draw_artist(body)
            self._axes.draw_artist(tip)
        return np.asarray(self._agg.buffer_rgba())[:, :, :3].copy()
