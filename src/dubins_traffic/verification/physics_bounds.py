"""Checks records of worlds that another program simulates: bounds, contacts and times."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from dubins_traffic.cars.state import Contact, Frames, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import OUTSIDE, Instance
from dubins_traffic.record.reader import Record
from dubins_traffic.verification.result import Difference
from dubins_traffic.verification.worlds import Meetings, by_tick, put_frame


@dataclass(frozen=True, slots=True)
class Slack:
    """Tolerances with which the world of another program has to keep the bounds.

    In `window` seconds a car moves and turns by at most `share` times what the bounds allow, and `metres` and
    `radians`. Bodies that have a contact are at most `gap` metres apart at the frame before it or at its own; bodies
    that overlap by more than `overlap` metres have one.
    """

    window: float
    share: float
    metres: float
    radians: float
    gap: float
    overlap: float


PHYSICS: Final = Slack(window=0.2, share=1.1, metres=0.02, radians=0.1, gap=0.03, overlap=0.005)
"""Tolerances for Gazebo and any other simulator in lockstep."""
TRACKED: Final = Slack(window=1.0, share=1.5, metres=0.25, radians=0.5, gap=0.03, overlap=0.005)
"""Tolerances for poses that another process sends in real time, late and early."""
UNIT: Final = 1e-6
"""Largest difference of the length of a heading from 1."""


def slack_of(instance: Instance) -> Slack:
    """Return the tolerances for the world of an instance."""
    return TRACKED if instance.simulator in OUTSIDE else PHYSICS


def world_difference(record: Record) -> Difference | None:
    """Return the first place in the frames of `record` that bounds, bodies or times exclude.

    No car within its bounds can have done it, or contacts don't fit the poses or are not in order of time.
    """
    if not len(record.frames):
        return None
    slack = slack_of(record.instance)
    differences = [
        _heading(record),
        _motion(record.instance, record.frames, slack),
        _times(record),
        _contacts(record, slack),
    ]
    return min((one for one in differences if one is not None), key=lambda one: one.tick or 0, default=None)


def _heading(record: Record) -> Difference | None:
    frames = record.frames
    length = np.hypot(frames.c, frames.s)
    at = np.argwhere(np.abs(length - 1.0) > UNIT)
    if not len(at):
        return None
    f, n = int(at[0, 0]), int(at[0, 1])
    expected = f"1 within {UNIT:g}"
    return Difference("length of the heading", float(length[f, n]), expected, f, record.instance.names[n])


def _motion(instance: Instance, frames: Frames, slack: Slack) -> Difference | None:
    """Check speed, yaw rate and turning radius between frames."""
    bounds, period = instance.problem.car.bounds, instance.problem.period
    ticks = max(1, round(slack.window / period))
    fastest = max(abs(bounds.speed_low), bounds.speed)
    dx, dy = np.diff(frames.x, axis=0), np.diff(frames.y, axis=0)
    dc = frames.c[1:] * frames.c[:-1] + frames.s[1:] * frames.s[:-1]
    ds = frames.s[1:] * frames.c[:-1] - frames.c[1:] * frames.s[:-1]
    turned, path = _summed(np.arctan2(ds, dc)), _summed(np.hypot(dx, dy))
    worst: Difference | None = None
    for step in sorted({1, min(ticks, len(frames) - 1)} - {0}):
        moved = np.hypot(frames.x[step:] - frames.x[:-step], frames.y[step:] - frames.y[:-step])
        angle, way = np.abs(turned[step:] - turned[:-step]), path[step:] - path[:-step]
        time = step * period
        limits: list[tuple[str, Floats, Floats | float]] = [
            ("metres moved", moved, slack.share * fastest * time + slack.metres),
            ("radians turned", angle, slack.share * bounds.yaw_rate * time + slack.radians),
        ]
        if bounds.turning_radius > 0.0:
            most = slack.share * way / bounds.turning_radius + slack.radians
            limits.append(("radians turned on a way bound by the turning radius", angle, most))
        for what, values, limit in limits:
            over = _over(f"{what} in {time:.3f} s", values, limit, step, instance)
            if over is not None and (worst is None or (over.tick or 0) < (worst.tick or 0)):
                worst = over
    return worst


def _summed(steps: Floats) -> Floats:
    return np.concatenate([np.zeros((1, steps.shape[1])), np.cumsum(steps, axis=0)])


def _over(what: str, values: Floats, limit: Floats | float, step: int, instance: Instance) -> Difference | None:
    most = np.broadcast_to(limit, values.shape)
    at = np.argwhere(values > most)
    if not len(at):
        return None
    f, n = int(at[0, 0]), int(at[0, 1])
    return Difference(what, float(values[f, n]), f"at most {most[f, n]:.4f}", f + step, instance.names[n])


def _times(record: Record) -> Difference | None:
    """Check that contacts are in the order of their ticks, and their times within them."""
    rate, last = record.instance.problem.rate, 0
    for contact in record.frames.contacts:
        tick = contact.time * rate
        inside = contact.tick - 1 - 1e-6 <= tick <= contact.tick + 1e-6
        if not inside or contact.tick < last or not 0 < contact.tick < len(record.frames):
            expected = "times in order, each within its tick"
            return Difference("contact.time", contact.time, expected, contact.tick)
        last = contact.tick
    return None


def _contacts(record: Record, slack: Slack) -> Difference | None:
    """Check that bodies with a contact are near each other, and that bodies that overlap have a contact."""
    instance, frames = record.instance, record.frames
    contacts, meetings = by_tick(frames.contacts), Meetings(instance, frames)
    obstacles, state = len(instance.problem.obstacles), State.zeros(1, len(instance.names))
    for tick in range(len(frames)):
        for contact in contacts.get(tick, ()):
            if contact.other < -obstacles:
                return Difference("contact.other", contact.other, "an obstacle of the instance", tick)
            gap = _gap(meetings, frames, contact, state)
            if gap > slack.gap:
                what = f"gap at a contact with {_name(instance, contact.other)}"
                name = instance.names[contact.car]
                return Difference(what, gap, f"at most {slack.gap} m", tick, name)
        meetings.note((*contacts.get(tick, ()), *contacts.get(tick + 1, ())))
        put_frame(state, frames, tick)
        for (car, other), between in meetings.gaps(tick, state):
            if between < -slack.overlap and tick > 0:
                expected = f"a contact with {_name(instance, other)}: they overlap by {-between:.4f} m"
                return Difference("contact", None, expected, tick, instance.names[car])
    return None


def _gap(meetings: Meetings, frames: Frames, contact: Contact, state: State) -> float:
    """Return the smaller gap, metres, of the two frames between which a contact lies."""
    gaps: list[float] = []
    for f in (contact.tick - 1, contact.tick):
        put_frame(state, frames, f)
        gaps.append(meetings.bodies.separation(state, contact.car, contact.other)[0])
    return min(gaps)


def _name(instance: Instance, other: int) -> str:
    return instance.names[other] if other >= 0 else f"obstacle {-1 - other}"
