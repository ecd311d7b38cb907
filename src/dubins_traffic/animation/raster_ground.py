"""Shares of pixels that lines, discs and polygons cover: what the roads of a raster are painted with, once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import cast

import numpy as np

from dubins_traffic.kernels.angles import sincos
from dubins_traffic.kernels.arrays import Floats

TAU = 6.283185307179586
DIGITS = {
    "0": "1,0 3,0 4,1 4,5 3,6 1,6 0,5 0,1 1,0",
    "1": "0.6,1.2 2,0 2,6",
    "2": "0,1 1,0 3,0 4,1 4,2 0,6 4,6",
    "3": "0,0 4,0 2,2.4 3,2.4 4,3.4 4,5 3,6 1,6 0,5",
    "4": "3,6 3,0 0,4 4,4",
    "5": "4,0 0.4,0 0,2.6 3,2.6 4,3.6 4,5 3,6 1,6 0,5.4",
    "6": "3.4,0 1.4,0.8 0,3 0,5 1,6 3,6 4,5 4,3.6 3,2.6 1,2.6 0,3.6",
    "7": "0,0 4,0 1.4,6",
    "8": "1,0 3,0 4,1 4,2 3,2.8 1,2.8 0,2 0,1 1,0 M 1,2.8 3,2.8 4,3.8 4,5 3,6 1,6 0,5 0,3.8 1,2.8",
    "9": "0.6,6 2.6,5.2 4,3 4,1 3,0 1,0 0,1 0,2.4 1,3.4 3,3.4 4,2.4",
    "+": "2,1.6 2,4.8 M 0.4,3.2 3.6,3.2",
}
"""Digits as lines on a field of 4 by 6; ``M`` begins a new line."""


class Cover:
    """Shares of the pixels of a picture that shapes cover, 0 to 1; where shapes overlap, the greatest.

    Lengths and places are pixels; x goes right and y down.

    Attributes
    ----------
    share : (H, W)
        The shares.
    rows, columns : slice
        Outside these nothing is covered.
    """

    def __init__(self, width: int, height: int) -> None:
        self.share: Floats = np.zeros((height, width))
        self.rows, self.columns = slice(height, 0), slice(width, 0)

    def line(self, first: Sequence[float], last: Sequence[float], half: float) -> None:
        """Cover a line with round ends and half the width `half`."""
        (ax, ay), (bx, by) = first, last
        box = self._box(min(ax, bx), max(ax, bx), min(ay, by), max(ay, by), half)
        if box is None:
            return
        rows, columns, x, y = box
        dx, dy = bx - ax, by - ay
        length2 = max(dx * dx + dy * dy, 1e-12)
        along = np.clip(((x - ax) * dx + (y - ay) * dy) / length2, 0.0, 1.0)
        self._put(rows, columns, _away(x - ax - along * dx, y - ay - along * dy) - half)

    def path(self, points: Sequence[Sequence[float]], half: float) -> None:
        """Cover the lines from point to point."""
        for first, last in pairwise(points):
            self.line(first, last, half)

    def dashed(self, points: Sequence[Sequence[float]], half: float, on: float, off: float) -> None:
        """Cover the lines from point to point by `dashes` that go on evenly from each to the next."""
        before = 0.0
        for first, last in pairwise(points):
            self.dashes(first, last, half, on, off, before)
            before += float(np.sqrt((last[0] - first[0]) ** 2 + (last[1] - first[1]) ** 2))

    def dashes(
        self,
        first: Sequence[float],
        last: Sequence[float],
        half: float,
        on: float,
        off: float,
        before: float = 0.0,
    ) -> None:
        """Cover a line of strokes `on` long with gaps `off` between them, cut off straight at its ends.

        The first stroke begins so far `before` the line.
        """
        (ax, ay), (bx, by) = first, last
        length = float(np.sqrt((bx - ax) ** 2 + (by - ay) ** 2))
        box = self._box(min(ax, bx), max(ax, bx), min(ay, by), max(ay, by), half)
        if box is None or length == 0.0:
            return
        rows, columns, x, y = box
        cx, cy = (bx - ax) / length, (by - ay) / length
        u = (x - ax) * cx + (y - ay) * cy
        v = np.abs((y - ay) * cx - (x - ax) * cy)
        inner = u + before - np.floor((u + before) / (on + off)) * (on + off)
        stroke = np.abs(inner - 0.5 * on) - 0.5 * on
        self._put(rows, columns, np.maximum(np.maximum(stroke, v - half), np.abs(u - 0.5 * length) - 0.5 * length))

    def disc(self, x: float, y: float, radius: float) -> None:
        """Cover a disc."""
        box = self._box(x, x, y, y, radius)
        if box is not None:
            rows, columns, px, py = box
            self._put(rows, columns, _away(px - x, py - y) - radius)

    def ring(self, x: float, y: float, radius: float, half: float, dash: float = 0.0) -> None:
        """Cover a ring of half the width `half`; with a `dash`, strokes so long and gaps between them, about."""
        if dash == 0.0:
            box = self._box(x, x, y, y, radius + half)
            if box is not None:
                rows, columns, px, py = box
                self._put(rows, columns, np.abs(_away(px - x, py - y) - radius) - half)
            return
        count = max(6, round(TAU * radius / (1.8 * dash)))
        for k in range(count):
            arc = [sincos(TAU * (k + step * 0.5 / 4) / count) for step in range(5)]
            self.path([(x + radius * c, y - radius * s) for c, s in arc], half)

    def polygon(self, points: Sequence[Sequence[float]], half: float = 0.0) -> None:
        """Cover a simple polygon, made wider by `half` all round (below 0: narrower)."""
        corners = np.asarray(points, dtype=np.float64)
        low, high = corners.min(axis=0), corners.max(axis=0)
        box = self._box(low[0], high[0], low[1], high[1], max(half, 0.0))
        if box is None:
            return
        rows, columns, x, y = box
        inside = np.zeros(np.broadcast_shapes(x.shape, y.shape), dtype=np.bool_)
        away = np.full(inside.shape, np.inf)
        for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            dx, dy = bx - ax, by - ay
            if dy != 0.0:
                inside ^= ((ay > y) != (by > y)) & (x < ax + (y - ay) * dx / dy)
            along = np.clip(((x - ax) * dx + (y - ay) * dy) / max(dx * dx + dy * dy, 1e-12), 0.0, 1.0)
            away = np.minimum(away, _away(x - ax - along * dx, y - ay - along * dy))
        self._put(rows, columns, np.where(inside, -away, away) - half)

    def digits(self, words: str, x: float, y: float, size: float, half: float) -> None:
        """Cover digits, and plus signs, `size` high about a point."""
        unit = size / 6.0
        left = x - 0.5 * unit * (5.6 * len(words) - 1.6)
        for place, letter in enumerate(words):
            for stroke in DIGITS[letter].split(" M "):
                points = [[float(number) for number in point.split(",")] for point in stroke.split()]
                at = [(left + unit * (5.6 * place + px), y + unit * (py - 3.0)) for px, py in points]
                self.path(at, half)

    def _box(
        self, left: float, right: float, top: float, bottom: float, margin: float
    ) -> tuple[slice, slice, Floats, Floats] | None:
        """Return rows and columns that hold a box, and their pixels' centres x (1, w) and y (h, 1); None: outside."""
        height, width = self.share.shape
        margin += 1.0
        x0, x1 = max(0, int(left - margin)), min(width, int(right + margin) + 1)
        y0, y1 = max(0, int(top - margin)), min(height, int(bottom + margin) + 1)
        if x0 >= x1 or y0 >= y1:
            return None
        x = cast(Floats, np.arange(x0, x1) + 0.5)
        y = cast(Floats, np.arange(y0, y1) + 0.5)
        return slice(y0, y1), slice(x0, x1), x[None, :], y[:, None]

    def _put(self, rows: slice, columns: slice, distance: Floats) -> None:
        self.rows = slice(min(self.rows.start, rows.start), max(self.rows.stop, rows.stop))
        self.columns = slice(min(self.columns.start, columns.start), max(self.columns.stop, columns.stop))
        part = self.share[rows, columns]
        np.maximum(part, np.clip(0.5 - distance, 0.0, 1.0), out=part)


def blend(picture: Floats, cover: Cover, colour: str, opacity: float = 1.0) -> None:
    """Mix a colour, ``#RRGGBB``, into a picture (H, W, 3) of numbers 0 to 255, where a cover is."""
    part = picture[cover.rows, cover.columns]
    part += (rgb(colour) - part) * (opacity * cover.share[cover.rows, cover.columns, None])


def rgb(colour: str) -> Floats:
    """Return a colour, ``#RRGGBB``, as three numbers 0 to 255."""
    return np.array([float(int(colour[k : k + 2], 16)) for k in (1, 3, 5)])


def _away(dx: Floats, dy: Floats) -> Floats:
    return np.sqrt(dx * dx + dy * dy)
