"""Pictures of a network, an instance or a recorded trial (optional extra ``plot``)."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from dubins_traffic.animation.canvas import Canvas
from dubins_traffic.cars.body import Car
from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import Record
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.viewer.figures import STYLE, matplotlib, write_figure
from dubins_traffic.viewer.marks import breach_marks, contact_mark
from dubins_traffic.viewer.paths import Paths
from dubins_traffic.viewer.scene import obstacle_points
from dubins_traffic.viewer.shapes import poses_at

if TYPE_CHECKING:
    from dubins_traffic.scoring.score import Score

Subject: TypeAlias = "RoadNetwork | Instance | Record"


class Run(Protocol):
    """What came of a trial, and a sketch of its ways: a `dubins_traffic.Result`."""

    @property
    def instance(self) -> Instance:
        """What was run."""
        ...

    @property
    def score(self) -> Score:
        """Its score."""
        ...

    @property
    def paths(self) -> Paths | None:
        """The ways of the cars."""
        ...


def plot(subject: Subject | Run) -> Any:
    """Return a Matplotlib figure of a network, an instance, a record or the result of a trial.

    Parameters
    ----------
    subject : RoadNetwork, Instance, Record or Result
        What is drawn: of a record the paths of all cars, contacts, and the cars where they ended; of a result paths,
        as far as it has kept them, and the breaches of its verdict.

    Returns
    -------
    matplotlib.figure.Figure
        With one pair of axes in metres, to be drawn upon and saved. `pyplot` is not used and knows nothing of it, so
        nothing is left open; notebooks show it as the value of a cell.

    Raises
    ------
    MissingExtraError
        If matplotlib is not installed.

    Examples
    --------
    >>> import dubins_traffic as dt
    >>> figure = dt.plot(dt.RoadNetwork.grid(2, 3))
    >>> figure.axes[0].set_title("Six intersections").get_text()
    'Six intersections'
    """
    with matplotlib().rc_context(STYLE):
        return _draw(subject)


def write_plot(path: str | os.PathLike[str], subject: Subject | Run, *, overwrite: bool = False) -> None:
    """Draw `subject` into the file `path`: PNG, SVG or PDF, by its suffix.

    Parameters
    ----------
    path : path
        The picture to write; it appears only when complete.
    subject : RoadNetwork, Instance, Record or Result
        As `plot` takes it. Equal subjects give equal bytes with equal versions of matplotlib.
    overwrite : bool
        Whether a picture that is there may be replaced.

    Raises
    ------
    InputError
        If the suffix is none of these, `path` is refused (`files.require_output`), or the file can't be written.
    MissingExtraError
        If matplotlib is not installed.
    """
    write_figure(path, lambda: _draw(subject), overwrite=overwrite)


def _draw(subject: Subject | Run) -> Any:
    if isinstance(subject, RoadNetwork):
        canvas = Canvas(subject, Car(), ())
        canvas.roads()
        canvas.finish(f"Road network, {subject.summary}")
        return canvas.figure
    if isinstance(subject, Instance):
        canvas = _ground(subject, ())
        canvas.cars(subject, subject.starts)
        canvas.names(subject.problem)
        canvas.finish(f"{_heading(subject)}, {subject.duration:g} s")
        return canvas.figure
    instance = subject.instance
    if isinstance(subject, Record):
        frames = subject.frames
        if len(frames) == 0:
            raise InputError("nothing to draw", field="frames", value=0, expected="at least one frame")
        whole: list[Floats] = list(np.stack([frames.x, frames.y], axis=-1).swapaxes(0, 1))
        marks = [contact_mark(instance, contact) for contact in frames.contacts]
        canvas = _ground(instance, whole)
        canvas.trial(instance, whole, poses_at(frames, 0), poses_at(frames, len(frames) - 1), marks)
        canvas.names(instance.problem)
        span = (len(frames) - 1) / frames.rate
        how = "cut off" if subject.ending is None else subject.ending.end.value.replace("_", " ")
        canvas.finish(f"{_heading(instance)}, {span:.4g} s, end: {how}")
        return canvas.figure
    paths, score = subject.paths or Paths(), subject.score
    breaches = () if score.verdict is None else breach_marks(instance, score.verdict.violations)
    canvas = _ground(instance, paths.lines())
    canvas.trial(instance, paths.lines(), instance.starts, paths.last or instance.starts, breaches)
    canvas.names(instance.problem)
    canvas.finish(f"{_heading(instance)}, {score.duration_s:.4g} s, {score.summary}")
    return canvas.figure


def _heading(instance: Instance) -> str:
    return instance.title.capitalize()


def _ground(instance: Instance, lines: Sequence[Floats]) -> Canvas:
    """Return a canvas with roads, goals and obstacles of an instance, and room for its cars and their paths."""
    problem = instance.problem
    spans = [obstacle_points(obstacle) for obstacle in problem.obstacles]
    poses = np.array([[start.x, start.y] for start in instance.starts]).reshape(-1, 2)
    spans += [poses - problem.car.body.reach, poses + problem.car.body.reach, *lines]
    canvas = Canvas(problem.network, problem.car, spans)
    canvas.roads()
    canvas.problem(problem)
    return canvas
