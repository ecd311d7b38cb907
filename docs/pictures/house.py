"""Draws the pictures of docs/architecture.md from pyproject: ``python docs/pictures/house.py [FOLDER]``."""

from __future__ import annotations

import sys
import tomllib
from html import escape
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FAMILIES = {
    "#dbe9f6": "commands and runs",
    "#e4f1dc": "trials, drivers, worlds",
    "#fbeccb": "task, rules, problem",
    "#ececec": "ground",
}
GROUND = {"kernels", "files", "display", "errors", "record", "protocols", "outside"}
TASK = {"problem", "rules", "logic", "roads", "cars", "synthesis", "scoring"}
TRIALS = {
    "engine", "envs", "sandbox", "trial", "simulators", "agents", "controllers", "transports", "shield", "policies",
    "observations", "routing",
}  # fmt: skip
WHAT = {
    "cli": "one short file a command",
    "service": "accounts, the queue, pages, workers",
    "competition": "phases, submissions, places; frozen sets of problems, results",
    "falsification": "the search for the worst case",
    "campaign": "many trials, their reports; checks of controllers; bags, logs; live pages",
    "sessions": "drivers or worlds in other processes",
    "envs": "environments for learning",
    "engine": "many trials in one compiled pass",
    "runs": "the work of one command",
    "viewer": "pictures, replays; records held against what must have happened",
    "scoring": "metrics and verdicts, from frames",
    "sandbox": "strangers' controllers, limits, attacks",
    "trial": "the tick, and the frames of a trial",
    "simulators": "what stands behind the protocols",
    "shield": "the nearest command that keeps the rules",
    "policies": "how cars drive; the game of cells",
    "observations": "what a driver is told, as a vector too",
    "routing": "ways through the network",
    "protocols": "the seams, one file",
    "record": "one file a trial",
    "problem": "configurations, instances, how they are drawn",
    "rules": "propositions, order of arrival, referee",
    "logic": "formulas and monitors",
    "roads": "networks; bodies, motion, contact",
    "kernels": "what compiled functions share",
    "files": "files whole or not at all; what notebooks show; which version this is",
    "outside": "classes of the user's own",
    "errors": "one base class",
}


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


def layers() -> list[list[str]]:
    """Return the rooms of each layer that there is, top to bottom, as the contract on imports has them."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    (rooms,) = (one for one in project["tool"]["importlinter"]["contracts"] if one["id"] == "rooms")
    found = [[room.strip() for room in layer.split("|")] for layer in rooms["layers"]]
    there = [[room for room in layer if not room.startswith("(")] for layer in found]
    return [layer for layer in there if layer]


def colour_of(room: str) -> str:
    """Return the colour of a room's family."""
    commands, trials, task, ground = FAMILIES
    return ground if room in GROUND else task if room in TASK else trials if room in TRIALS else commands


def rooms() -> str:
    """Draw the rooms in their layers."""
    parts: list[str] = []
    for k, layer in enumerate(layers()):
        y, width = 14 + 33 * k, (468 - 8 * (len(layer) - 1)) / len(layer)
        for place, room in enumerate(layer):
            parts.append(box(14 + place * (width + 8), y, width, 26, room, colour_of(room)))
        parts.append(text(496, y + 17, WHAT.get(layer[0], ""), 12, "start", "#555"))
    low = 14 + 33 * len(layers()) + 12
    for place, (colour, words) in enumerate(FAMILIES.items()):
        parts.append(box(14 + 200 * place, low, 16, 16, "", colour))
        parts.append(text(36 + 200 * place, low + 13, words, 12, "start"))
    return picture(930, low + 30, "The rooms of the house; imports only go down", parts)


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
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent / "house"
    folder.mkdir(parents=True, exist_ok=True)
    for name, drawn in (("rooms.svg", rooms()), ("flow.svg", flow())):
        (folder / name).write_text(drawn, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
