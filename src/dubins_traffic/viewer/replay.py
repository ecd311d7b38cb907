"""A recorded trial as one self-contained page that plays it: no server, no network, opens from a file."""

from __future__ import annotations

import base64
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.body import Body, Disc, DiscObstacle, Obstacle
from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import InputError
from dubins_traffic.files import replace_file, require_output
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.propositions import NAMES
from dubins_traffic.scoring.verdict import Verdict
from dubins_traffic.viewer import palette
from dubins_traffic.viewer.marks import (
    Mark,
    breach_marks,
    excuse_mark,
    goal_numbers,
    goal_visits,
    marks_of,
    verdict_text,
)
from dubins_traffic.viewer.pages import PAGES, part, render
from dubins_traffic.viewer.scene import centre_lines, lane_hints, road_lines
from dubins_traffic.viewer.shapes import CENTRE, DASH, HINT, KERB, KERB_PIXELS

SCRIPTS = (
    "replay_marks.js",
    "replay_data.js",
    "replay_map.js",
    "replay_timeline.js",
    "replay_panel.js",
    "replay.js",
)
HEADING_STEPS = 32767
UNITS = ("s", "m")
LOOKS = {
    "kerb": [KERB, KERB_PIXELS],
    "centre": [CENTRE.metres, CENTRE.least],
    "hint": [HINT.metres, HINT.least],
    "dash": [*DASH],
}
"""Widths of lines of the map, metres and at least so many pixels, and the strokes and gaps of centre lines, metres."""


def write_replay(
    path: str | os.PathLike[str],
    instance: Instance,
    frames: Frames,
    ending: Ending | None,
    summary: Mapping[str, object] | None = None,
    marks: Sequence[Mark] = (),
    verdict: Verdict | None = None,
    *,
    overwrite: bool = False,
    at: float | None = None,
) -> None:
    """Write the page that replays a trial.

    Parameters
    ----------
    path : path
        The page to write; it appears only when complete.
    instance : Instance
        The instance that was tried.
    frames : Frames
        All frames of the trial in one block, at least one.
    ending : Ending or None
        How the trial ended; None if its record was cut off.
    summary : mapping, optional
        The score, name to value, shown beside the map in this order.
    marks : sequence of Mark
        What else to show on the timeline; contacts, events and visits of goals are there already.
    verdict : Verdict, optional
        The verdict on the trial: its breaches are marked on the timeline and on the map, and what excused the ego.
    overwrite : bool
        Whether a page that is there may be replaced.
    at : float, optional
        The second of the trial that the page shows first; by default its first.

    Raises
    ------
    InputError
        If there is no frame, `at` is not within the trial, `path` is refused (`files.require_output`), or the page
        can't be written.
    """
    require_output(path, "a page", PAGES, overwrite=overwrite)
    text = replay_page(instance, frames, ending, summary, marks, verdict, at)
    replace_file(Path(path), lambda draft: draft.write_text(text, encoding="utf-8", newline="\n"))


def replay_page(
    instance: Instance,
    frames: Frames,
    ending: Ending | None,
    summary: Mapping[str, object] | None = None,
    marks: Sequence[Mark] = (),
    verdict: Verdict | None = None,
    at: float | None = None,
) -> str:
    """Return the page that `write_replay` writes; equal arguments give equal text."""
    if len(frames) == 0:
        raise InputError("nothing to replay", field="frames", value=0, expected="at least one frame")
    last = (frames.first + len(frames) - 1) / frames.rate
    if at is not None and not frames.first / frames.rate <= at <= last:
        expected = f"a second of the trial, from {frames.first / frames.rate:g} to {last:g}"
        raise InputError("not in the trial", file="--at", value=at, expected=expected)
    breaches = [] if verdict is None else breach_marks(instance, verdict.violations)
    every = marks_of(instance, frames, [*marks, *breaches])
    document = document_of(instance, frames, ending, summary, every)
    document |= {} if at is None else {"begin": at}
    document["verdict"] = None if verdict is None else _verdict(instance, verdict, every)
    return page_of(document)


def page_of(
    document: Mapping[str, Any],
    *,
    template: str = "viewer/replay.html",
    style: str = "",
    scripts: Sequence[str] = (),
    **given: object,
) -> str:
    """Return a page with the map, the timeline and the panel of a trial.

    Parameters
    ----------
    document : Mapping
        What `document_of` returns.
    template : str
        The page of a replay, or one that extends it; it is given all of `given`.
    style : str
        Its style sheet, after that of the replay.
    scripts : sequence of str
        Its scripts, after those of the replay and in the same scope.
    """
    parts = [part(f"viewer/{name}") for name in SCRIPTS]
    body = [f"const LOOKS = {json.dumps(LOOKS)};", *parts, *scripts]
    script = "\n".join(["(() => {", '"use strict";', *body, "})();"])
    sheet = palette.style_sheet() + part("viewer/replay.css") + style
    return render(template, title=document["title"], style=sheet, script=script, document=document, **given)


def document_of(
    instance: Instance,
    frames: Frames,
    ending: Ending | None,
    summary: Mapping[str, object] | None = None,
    marks: Sequence[Mark] = (),
) -> dict[str, Any]:
    """Return what the script of a page is given of a trial; points are relative to `origin_of` its roads."""
    problem = instance.problem
    origin = origin_of(problem)
    return {
        "title": f"Trial {instance.trial} of seed {instance.seed}",
        "rate": frames.rate,
        "first": frames.first,
        "frames": len(frames),
        "origin": [float(origin[0]), float(origin[1])],
        "cars": [
            {"name": name, "kind": kind, "colour": palette.car_colour(index)}
            for index, (name, kind) in enumerate(
                zip(instance.names, ("ego", *(agent.type for agent in instance.e_agents)), strict=True)
            )
        ],
        "body": _body(problem.car.body),
        "w": problem.car.w,
        "sensing": problem.sensing_radius,
        "roads": _roads(problem, origin),
        "goals": {
            "vertices": list(goal_numbers(problem)),
            "radius": problem.intersection_radius,
            "numbers": list(goal_numbers(problem).values()),
            "visits": goal_visits(instance, frames),
        },
        "obstacles": [_obstacle(obstacle, origin) for obstacle in problem.obstacles],
        "series": _series(frames, origin),
        "ending": None if ending is None else {"end": ending.end.value, "detail": ending.detail},
        "summary": shown_summary(summary or {}),
        "flags": NAMES,
        "marks": [mark_of(mark, origin) for mark in marks],
        "verdict": None,
    }


def origin_of(problem: Problem) -> Floats:
    """Return the middle of the roads, (2,): single precision is enough for lengths from there."""
    points = problem.network.points
    middle: Floats = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return middle


def shown_summary(summary: Mapping[str, object]) -> list[list[str]]:
    """Return a score, name to value, as pairs of texts."""
    return [[_caption(name), _shown(value)] for name, value in summary.items()]


def _roads(problem: Problem, origin: Floats) -> dict[str, Any]:
    network, car = problem.network, problem.car
    return {
        "width": car.road_width,
        "lattice": [list(point) for point in network.intersections],
        "points": _f32(network.points - origin),
        "ends": _i32(network.ends),
        "segments": [list(segment) for segment in network.segments],
        "centres": _f32(centre_lines(network, 0.5 * car.road_width) - origin),
        "hints": _f32(lane_hints(network, car.w) - origin),
        **({} if network.is_straight else {"lines": _f32(road_lines(network) - origin)}),
    }


def _series(frames: Frames, origin: Floats) -> dict[str, str]:
    """Pack the arrays of the frames car after car: (N, F) float32, headings int16, the discrete ones as runs."""
    heading = np.round(np.nan_to_num(frames.theta) * (HEADING_STEPS / math.pi)).astype("<i2")
    return {
        "x": _f32(frames.x.T - origin[0]),
        "y": _f32(frames.y.T - origin[1]),
        "heading": _base64(heading.T),
        "speed": _f32(frames.speed.T),
        "yawRate": _f32(frames.yaw_rate.T),
        "segment": _runs(frames.segment),
        "at": _runs(frames.at),
        "bits": _runs(frames.bits),
    }


def _runs(values: npt.NDArray[Any]) -> str:
    """Pack (F, N) integers as, for every car, the number of runs and then (first frame, value) of each."""
    packed: list[npt.NDArray[Any]] = []
    for column in values.T:
        first = np.flatnonzero(np.concatenate([[True], column[1:] != column[:-1]]))
        packed += [np.array([len(first)]), np.stack([first, column[first]], axis=1).ravel()]
    return _i32(np.concatenate(packed))


def _f32(values: npt.NDArray[Any]) -> str:
    return _base64(values.astype("<f4"))


def _i32(values: npt.NDArray[Any]) -> str:
    return _base64(values.astype("<i4"))


def _base64(values: npt.NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode("ascii")


def _body(body: Body) -> dict[str, float]:
    return {"radius": body.radius} if isinstance(body, Disc) else {"length": body.length, "width": body.width}


def _obstacle(obstacle: Obstacle, origin: Floats) -> dict[str, Any]:
    if isinstance(obstacle, DiscObstacle):
        return {"disc": [obstacle.x - float(origin[0]), obstacle.y - float(origin[1]), obstacle.radius]}
    return {"polygon": (np.asarray(obstacle.vertices) - origin).tolist()}


def _verdict(instance: Instance, verdict: Verdict, marks: Sequence[Mark]) -> dict[str, Any]:
    """Return the ruling, why it is so, and which of `marks` excuses the ego."""
    mark = excuse_mark(instance, verdict)
    return {
        "ruling": verdict.verdict.value,
        "why": verdict_text(verdict),
        "excuse": None if mark is None else marks.index(mark),
    }


def mark_of(mark: Mark, origin: Floats) -> dict[str, Any]:
    """Return a mark as the script of a page reads it."""
    point = None if mark.point is None else [mark.point[0] - float(origin[0]), mark.point[1] - float(origin[1])]
    return {
        "time": mark.time,
        "since": mark.since,
        "kind": mark.kind,
        "text": mark.text,
        "car": mark.car,
        "rule": mark.rule,
        "point": point,
    }


def _caption(name: str) -> str:
    """Return the name of a score as people read it: ``off_road_s`` as ``off road (s)``."""
    words, _, unit = name.rpartition("_")
    return f"{words} ({unit})".replace("_", " ") if words and unit in UNITS else name.replace("_", " ")


def _shown(value: object) -> str:
    """Return a value of a score as people read it."""
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Mapping):
        pairs = cast("Mapping[object, object]", value).items()
        return ", ".join(f"{name}: {_shown(item)}" for name, item in pairs) or "none"
    if isinstance(value, list | tuple):
        items = cast("Sequence[object]", value)
        if any(isinstance(item, Mapping) for item in items):
            return str(len(items))
        return ", ".join(_shown(item) for item in items) or "none"
    return str(value)
