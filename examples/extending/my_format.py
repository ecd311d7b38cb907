"""A map format of one's own: a town drawn with characters (docs/extending/map-format.md).

dubins-traffic convert corner.grid -o corner.json --map-format examples/extending/my_format.py:GridMap
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import dubins_traffic as dt


class GridMap:
    """Drawings of towns: ``+`` is an intersection, ``-`` and ``|`` are roads to the next one.

    The first line says ``grid-map`` and how many metres a road is long; the lowest line of the drawing is y = 0::

        grid-map 3
        +-+-+
        |   |
        +-+-+
    """

    name = "grid-map"
    suffixes = (".grid",)
    description = "a town drawn with + - |"

    def sniff(self, text: str) -> bool:
        """Tell whether a text begins as a drawing does."""
        return text.startswith("grid-map ")

    def read(self, text: str, file: str | None = None) -> Mapping[str, Any]:
        """Return the fields of RND version 0 that a drawing stands for."""
        head, *lines = text.rstrip().split("\n")
        try:
            length = float(head.removeprefix("grid-map "))
        except ValueError:
            raise dt.InputError("not a length", file=file, value=head, expected="grid-map METRES") from None
        rows = lines[::-1]
        segments: list[list[int]] = []
        for row, line in enumerate(rows):
            for column, mark in enumerate(line):
                x, y = column // 2, row // 2
                place = (row % 2, column % 2)
                if mark == "-" and place == (0, 1):
                    segments.append([x, y, x + 1, y])
                elif mark == "|" and place == (1, 0):
                    segments.append([x, y, x, y + 1])
                elif mark != " " and not (mark == "+" and place == (0, 0)):
                    where = f"line {len(lines) - row + 1}, column {column + 1}"
                    raise dt.InputError("not part of a drawing", file=file, field=where, value=mark, expected="+ - |")
        return {"version": 0, "length": length, "segments": segments}

    def write(self, document: Mapping[str, Any]) -> str:
        """Return the drawing of a network; InputError if it can't be drawn."""
        if document["version"] != 0:
            raise dt.InputError("can't be drawn", file=self.name, expected="straight roads on a lattice")
        if others := document.keys() - {"version", "length", "transform", "shape", "segments"}:
            raise dt.InputError("can't be drawn", file=self.name, value=sorted(others), expected="no other keys")
        segments: list[list[int]] = document["segments"]
        left, low = min(min(a, c) for a, _, c, _ in segments), min(min(b, d) for _, b, _, d in segments)
        if any(abs(a - c) + abs(b - d) != 1 for a, b, c, d in segments) or any(document["transform"]) or left or low:
            raise dt.InputError("can't be drawn", file=self.name, expected="an unmoved grid whose corner is 0, 0")
        rows, columns = document["shape"]
        page = [[" "] * (2 * columns - 1) for _ in range(2 * rows - 1)]
        for a, b, c, d in segments:
            page[2 * b][2 * a] = page[2 * d][2 * c] = "+"
            page[b + d][a + c] = "-" if b == d else "|"
        return "\n".join([f"grid-map {document['length']}", *("".join(row).rstrip() for row in page[::-1])]) + "\n"
