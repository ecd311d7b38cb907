"""What is in the way: samples of the path ahead, and the first body that a car on them would come too near to."""

from __future__ import annotations

from math import sqrt

from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.boxes import Box, separation
from dubins_traffic.kernels.compile import jit
from dubins_traffic.policies.lanes.paths import GATE_X, GATE_Y, HIGH, LENGTH, LOW, NO_STOP, STOP
from dubins_traffic.policies.lanes.tracking import next_row, place_on

SAMPLES = 46
SPACING = 0.1
"""The path is looked at every 0.1 m, 4.5 m ahead."""
RETURN = 0.7
"""Metres in which a car that has passed something returns to its path."""

PX, PY, TX, TY, P_LOW, P_HIGH = range(6)
SAMPLE_FIELDS = 6

OX, OY, OC, OS, O_SPEED, O_YAW, O_STILL, O_SEEN, O_GAP = range(9)
OTHER_FIELDS = 9
"""Another car: pose, speed, yaw rate, seconds since it last moved, whether it is seen, the gap to it now."""
NOBODY = -(2**40)


@jit
def sample_path(
    path: Floats, row: int, sigma: float, first: int, end: int, loop: int, sample: Floats
) -> None:
    """Fill `sample` (SAMPLES, SAMPLE_FIELDS) with points, tangents and bounds of the offset ahead on a path."""
    for k in range(sample.shape[0]):
        for _ in range(64):
            if sigma <= path[row, LENGTH]:
                break
            sigma -= path[row, LENGTH]
            row = next_row(row, first, end, loop)
        px, py, tx, ty = place_on(path, row, sigma)
        sample[k, PX] = px
        sample[k, PY] = py
        sample[k, TX] = tx
        sample[k, TY] = ty
        sample[k, P_LOW] = path[row, LOW]
        sample[k, P_HIGH] = path[row, HIGH]
        sigma += SPACING


@jit
def offset_at(distance: float, begin: float, aim: float, ramp: float, until: float) -> float:
    """Return the offset to the left of a manoeuvre after `distance` metres: from `begin` to `aim` within `ramp`,
    and from `until` on back to 0 within RETURN.
    """
    if distance >= until:
        return aim * max(0.0, 1.0 - (distance - until) / RETURN)
    if distance >= ramp:
        return aim
    return begin + (aim - begin) * max(distance, 0.0) / ramp


@jit
def gap_to(
    x: float,
    y: float,
    c: float,
    s: float,
    half_length: float,
    half_width: float,
    rounding: float,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    o_length: float,
    o_width: float,
    o_rounding: float,
) -> float:
    """Return the gap between two rounded boxes; for two discs without ado."""
    if half_length + half_width + o_length + o_width == 0.0:
        return sqrt((ox - x) * (ox - x) + (oy - y) * (oy - y)) - rounding - o_rounding
    gap, _, _, _, _ = separation(
        Box(x, y, c, s, half_length, half_width, rounding), Box(ox, oy, oc, os, o_length, o_width, o_rounding)
    )
    return gap


@jit
def first_conflict(
    sample: Floats,
    last: int,
    done: float,
    begin: float,
    aim: float,
    ramp: float,
    until: float,
    half_length: float,
    half_width: float,
    rounding: float,
    reach: float,
    others: Floats,
    parts: Floats,
    part_from: int,
    part_to: int,
    still_margin: float,
    moving_margin: float,
) -> tuple[int, int, int]:
    """Return (first, who, nearest): the first of the samples 1..`last` at which a car that follows them comes nearer
    to a body than the margin, that body (part p: -1 - p), and the sample nearest to it; (-1, NOBODY, -1) if none.

    `done` metres of the manoeuvre (`begin`, `aim`, `ramp`, `until`: see `offset_at`) are behind. `others`
    (N, OTHER_FIELDS) are cars with the same body; `parts` rounded boxes that never move. Where a gap is smaller than
    the margin already, it may stay so.
    """  # fmt: skip
    px = py = pc = ps = 0.0
    for k in range(last + 1):
        row = sample[k]
        offset = offset_at(done + SPACING * k, begin, aim, ramp, until)
        if k > 0:
            offset = min(max(offset, row[P_LOW]), row[P_HIGH])
        tx = row[TX]
        ty = row[TY]
        x = row[PX] - offset * ty
        y = row[PY] + offset * tx
        for n in range(others.shape[0]):
            o = others[n]
            margin = still_margin if o[O_STILL] > 0.0 else moving_margin
            margin = min(margin, max(o[O_GAP] - 0.005, 0.0))
            dx = o[OX] - x
            dy = o[OY] - y
            near = 2.0 * reach + margin
            if o[O_SEEN] != 0.0 and k > 0 and dx * dx + dy * dy < near * near and comes_nearer(
                px, py, pc, ps, x, y, tx, ty, half_length, half_width, rounding,
                o[OX], o[OY], o[OC], o[OS], half_length, half_width, rounding, margin,
            ):  # fmt: skip
                return k, n, nearest_sample(sample, k, o[OX], o[OY])
        for p in range(part_from, part_to):
            o = parts[p]
            dx = o[0] - x
            dy = o[1] - y
            near = reach + o[7] + still_margin
            if k > 0 and dx * dx + dy * dy < near * near and comes_nearer(
                px, py, pc, ps, x, y, tx, ty, half_length, half_width, rounding,
                o[0], o[1], o[2], o[3], o[4], o[5], o[6], still_margin,
            ):  # fmt: skip
                return k, -1 - p, nearest_sample(sample, k, o[0], o[1])
        px, py, pc, ps = x, y, tx, ty
    return -1, NOBODY, -1


@jit
def comes_nearer(
    px: float,
    py: float,
    pc: float,
    ps: float,
    x: float,
    y: float,
    c: float,
    s: float,
    half_length: float,
    half_width: float,
    rounding: float,
    ox: float,
    oy: float,
    oc: float,
    os: float,
    o_length: float,
    o_width: float,
    o_rounding: float,
    margin: float,
) -> bool:
    """Whether a body comes nearer than `margin` to another in going from the pose (px, ..) to (x, ..)."""
    gap = gap_to(x, y, c, s, half_length, half_width, rounding, ox, oy, oc, os, o_length, o_width, o_rounding)
    if gap >= margin:
        return False
    before = gap_to(
        px, py, pc, ps, half_length, half_width, rounding, ox, oy, oc, os, o_length, o_width, o_rounding
    )
    return gap < before


@jit
def nearest_sample(sample: Floats, k: int, x: float, y: float) -> int:
    """Return the sample from `k` on, as long as they come nearer, that is nearest to a point."""
    best = 1e300
    for m in range(k, sample.shape[0]):
        dx = x - sample[m, PX]
        dy = y - sample[m, PY]
        d2 = dx * dx + dy * dy
        if d2 > best:
            return m - 1
        best = d2
    return sample.shape[0] - 1


@jit
def next_gate(
    path: Floats, row: int, sigma: float, behind: float, first: int, end: int, loop: int
) -> tuple[float, float, float]:
    """Return (distance, x, y): metres to the next line to wait at, and the intersection behind it.

    A line up to `behind` metres behind counts too. The distance is NO_STOP if there is none within 4 m.
    """
    far = -sigma
    for _ in range(64):
        to_line = far + path[row, STOP]
        if path[row, STOP] < NO_STOP and to_line >= -behind:
            if to_line > 4.0:
                break
            return to_line, path[row, GATE_X], path[row, GATE_Y]
        far += path[row, LENGTH]
        if far > 4.0:
            break
        row = next_row(row, first, end, loop)
    return NO_STOP, 0.0, 0.0
