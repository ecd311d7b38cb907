"""Draws the pictures of docs/architecture.md, one from pyproject: ``python docs/pictures/house.py [FOLDER]``."""

from __future__ import annotations

import sys
import tomllib
from argparse import ArgumentParser
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FAMILIES = {
    "#dbe9f6": "commands and runs",
    "#e4f1dc": "trials, drivers, worlds",
    "#fbeccb": "task, rules, problem",
    "#ececec": "ground",
}
BUILDINGS = {
    "roof": ("#dbe9f6", "the roof: commands, and what compiles kernels"),
    "arena": ("#fbeccb", "arena: strangers compete"),
    "research": ("#e4f1dc", "research: what many trials show"),
    "bridges": ("#f3e3f1", "bridges: other programs take part"),
    "core": ("#ececec", "core: a trial and its judgement"),
}
"""Colour and caption of each building."""


def text(x: float, y: float, words: str, size: int = 13, anchor: str = "middle", colour: str = "#222") -> str:
    """Return words at a place."""
    place = f'x="{x:g}" y="{y:g}" font-size="{size}" text-anchor="{anchor}"'
    return f'<text {place} font-family="sans-serif" fill="{colour}">{escape(words)}</text>'


def box(x: float, y: float, width: float, height: float, words: str, colour: str) -> str:
    """Return a box with one or more lines of words in its middle."""
    lines = words.split("\n")
    first = y + height / 2 + 4.5 - 8 * (len(lines) - 1)
    shape = f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="5" fill="{colour}" stroke="#888"/>'
    return shape + "".join(text(x + width / 2, first + 16 * k, line) for k, line in enumerate(lines))


def arrow(*points: tuple[float, float]) -> str:
    """Return a line through points with a head at its end."""
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    return f'<polyline points="{path}" fill="none" stroke="#444" stroke-width="1.4" marker-end="url(#head)"/>'


def picture(width: int, height: int, title: str, parts: list[str]) -> str:
    """Return a page."""
    head = (
        '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#444"/></marker></defs>'
    )
    size = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    opening = f'<svg xmlns="http://www.w3.org/2000/svg" {size}>'
    white = f'<rect width="{width}" height="{height}" fill="#fff"/>'
    return "\n".join([opening, f"<title>{escape(title)}</title>", head, white, *parts, "</svg>"]) + "\n"


def buildings() -> dict[str, list[list[str]]]:
    """Return the rooms of each line of each building, top to bottom, as the contract on imports has them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (contract,) = project["tool"]["importlinter"]["contracts"]
    return {name: [line.split(" | ") for line in contract[name]] for name in BUILDINGS}


def building(name: str, lines: list[list[str]], x: float, y: float, width: float) -> list[str]:
    """Draw a building with its rooms, and its caption above them."""
    colour, caption = BUILDINGS[name]
    height = 34 + 33 * len(lines)
    frame = f'x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="8"'
    parts = [
        f'<rect {frame} fill="{colour}" stroke="#666"/>',
        text(x + width / 2, y + 19, caption),
    ]
    for k, line in enumerate(lines):
        each = (width - 20 - 8 * (len(line) - 1)) / len(line)
        for place, room in enumerate(line):
            parts.append(box(x + 10 + place * (each + 8), y + 28 + 33 * k, each, 26, room, "#fff"))
    return parts


def rooms() -> str:
    """Draw the buildings: the roof on top, three beside each other, core at the bottom, its lines in two columns."""
    there = buildings()
    roof, core = [[room for line in there["roof"] for room in line]], there["core"]
    pairs = [[*first, *second] for first, second in zip(core[0::2], [*core[1::2], []], strict=False)]
    parts = building("roof", roof, 14, 14, 1052)
    widths = {"arena": 240, "research": 500, "bridges": 280}
    x, deepest = 14.0, 0
    for name, width in widths.items():
        parts += building(name, there[name], x, 104, width)
        x += width + 16
        deepest = max(deepest, len(there[name]))
    low = 104 + 34 + 33 * deepest + 40
    parts += building("core", pairs, 14, low, 1052)
    for place in (134, 520, 910):
        parts += [arrow((place, 81), (place, 102)), arrow((place, low - 38), (place, low - 2))]
    parts += [arrow((254, 190), (268, 190)), arrow((770, 190), (784, 190))]
    return picture(1080, low + 34 + 33 * len(pairs) + 14, "The buildings and their rooms; imports only go down", parts)


def flow() -> str:
    """Draw the way from a configuration to a report."""
    blue, green, sand, grey = FAMILIES
    parts = [
        box(14, 60, 120, 56, "configuration\n+ seed, trial", sand),
        arrow((134, 88), (172, 88)), text(153, 80, "draw", 11),
        box(174, 60, 92, 56, "Instance", sand),
        arrow((266, 88), (302, 88)),
        '<rect x="304" y="22" width="330" height="196" rx="8" fill="#f7fbf4" stroke="#7a9"/>',
        text(469, 42, "Trial: one tick, frame k to k + 1", 13),
        box(318, 56, 92, 36, "1 sense", green), arrow((410, 74), (420, 74)),
        box(422, 56, 92, 36, "2 decide", green), arrow((514, 74), (524, 74)),
        box(526, 56, 94, 36, "3 clip", green), arrow((573, 92), (573, 116)),
        box(526, 118, 94, 36, "4 move", green), arrow((526, 136), (516, 136)),
        box(422, 118, 92, 36, "5 label", green), arrow((422, 136), (412, 136)),
        box(318, 118, 92, 36, "6 push", green), arrow((364, 118), (364, 94)),
        text(469, 176, "drivers: controller (under a shield), e-agents,", 11),
        text(469, 191, "remote cars over a transport", 11),
        text(469, 207, "world: embedded, Gazebo, or one that is not ours", 11),
        arrow((634, 88), (690, 88)), text(661, 80, "blocks", 10), text(661, 103, "of frames", 10),
        box(692, 22, 150, 36, "record (MCAP)", grey),
        box(692, 70, 150, 36, "metrics", sand),
        box(692, 118, 150, 36, "referee, formulas", sand),
        arrow((842, 88), (884, 88)), arrow((842, 136), (862, 136), (862, 100), (884, 100)),
        box(886, 66, 130, 50, "Score\nwith its Verdict", sand),
        arrow((767, 22), (767, 10), (1080, 10), (1080, 56)),
        arrow((1016, 91), (1038, 91)),
        box(1040, 58, 110, 66, "report, plot,\nreplay, table", blue),
        arrow((842, 40), (950, 40), (950, 64)), text(900, 34, "scored again", 11),
        box(304, 240, 330, 44, "engine: the same steps\nfor many trials in one compiled pass", green),
        arrow((220, 116), (220, 262), (302, 262)),
        arrow((634, 262), (950, 262), (950, 118)), text(790, 255, "the same scores, bit for bit", 11),
    ]  # fmt: skip
    return picture(1166, 300, "From a configuration to a report", parts)


def main() -> int:
    """Write both pictures."""
    parser = ArgumentParser(description="Draw the pictures of docs/architecture.md.")
    home = Path(__file__).parent / "house"
    parser.add_argument("folder", nargs="?", type=Path, default=home, help="where to draw them")
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for name, drawn in (("rooms.svg", rooms()), ("flow.svg", flow())):
        (folder / name).write_text(drawn, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
