"""Draws the pictures of docs/task.md: ``python docs/pictures/make.py [FOLDER]``, needs the extra ``plot``."""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path

from bends import free_bend
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from stage import (
    BAD,
    FAINT,
    GOOD,
    INK,
    RHO,
    ROAD,
    STAR,
    R,
    W,
    bend,
    column,
    inward,
    outward,
    pose,
    row,
    write,
)  # fmt: skip

from dubins_traffic.viewer.palette import AGENT_COLOURS, EGO_COLOUR

HALF = (-2.6, -2.75, 2.9, 2.75)
STRIP = (-4.2, -1.15, 4.2, 1.15)
LOW = -W
BEARINGS = (270, 90, 0, 180)
ARRIVALS = ((120, 3), (63, 1), (122, 2), (138, 4))
"""Ticket, in ticks of 1/30 s, and place in the order: the ego, A, B, C."""


def ground() -> Figure:
    """Draw a crossing with its measures."""
    figure, (panel,) = row(STAR, (-4.0, -2.9, 4.0, 2.6))
    panel.disc()
    panel.approach(0, 90, 180, 270)
    ego = inward(180, 0.2)
    panel.cars(ego, names=False)
    panel.arrow([(ego.x + 0.2, ego.y), (-0.45, ego.y)], EGO_COLOUR)
    panel.note(ego.x, -0.95, "body, radius \u03c1", colour=EGO_COLOUR)
    panel.line([(ego.x, -0.83), (ego.x, ego.y - RHO)], EGO_COLOUR, width=0.9)
    panel.span((0, 0), (0.7071 * R, 0.7071 * R), "R", (0.32, 0.5))
    panel.note(0.0, -0.18, "v")
    panel.line([(-0.02, 0.0), (0.02, 0.0)], INK, width=4)
    panel.note(1.0, 0.98, "disc(v)", ha="left")
    panel.span((-3.3, -2 * W), (-3.3, 2 * W), "road 4w", (-3.3, 0.85))
    panel.span((3.0, 0.0), (3.0, 2 * W), "lane 2w", (3.0, 0.85))
    panel.note(1.7, -1.15, "edge of the disc:\nwhere one stops", ha="left")
    panel.line([(1.68, -1.0), (0.56, -0.95)], INK, width=0.9)
    panel.note(1.05, -2.0, "approach: body outside the\ndisc and at most 0.5 m from it", ha="left")
    panel.line([(1.02, -1.85), (0.4, -1.3)], INK, width=0.9)
    panel.line([(0.3, -2.85), (0.3, -1.55)], FAINT, width=1.2, style=":")
    panel.note(-0.75, -2.0, "middle of the lane: l = \u2212w", ha="right")
    panel.line([(-0.72, -2.0), (0.27, -2.0)], FAINT, width=0.8)
    panel.title("A crossing v: three or more segments meet")
    return figure


def collision() -> Figure:
    """Draw two contacts and who is at fault in them."""
    box = (-2.75, -1.9, 2.6, 1.5)
    figure, (left, right) = row(STAR, box, box)
    for panel in (left, right):
        panel.disc()
    ahead = inward(180, 0.25)
    ego = pose(ahead.x - 2 * RHO, ahead.y, 0)
    left.cars(ego, ahead, names=False)
    left.arrow([(ego.x - 0.95, ego.y), (ego.x - RHO, ego.y)], EGO_COLOUR)
    left.cross(ego.x + RHO, ego.y)
    left.note(ego.x - 0.2, ego.y + 0.34, "ego", bold=True)
    left.note(ahead.x + 0.08, ahead.y + 0.34, "A", bold=True)
    left.note(0.72, -1.4, "A stands: the ego\nis at fault", ha="left")
    left.title("1, collision: the ego runs into A", "bad")
    ego, other = pose(-0.3 + RHO, -0.3, 0), pose(-0.3 + RHO, -0.3 + 2 * RHO, -90)
    right.cars(ego, other, names=False)
    right.arrow([(ego.x - 1.1, ego.y), (ego.x - RHO, ego.y)], EGO_COLOUR)
    right.arrow([(other.x, other.y + 1.0), (other.x, other.y + RHO)], "#A86F00")
    right.cross(ego.x, ego.y + RHO)
    right.note(ego.x + 0.25, ego.y - 0.22, "ego", ha="left", bold=True)
    right.note(other.x + 0.25, other.y + 0.3, "A", ha="left", bold=True)
    right.note(0.72, -1.4, "the ego passes,\nA drives into it:\nA is at fault", ha="left")
    right.title("1, collision, and E2: A runs into the ego", "bad")
    return figure


def road() -> Figure:
    """Draw a centre within and beyond the road's edge."""
    box = (-2.1, -1.3, 2.1, 1.0)
    figure, (left, right) = row(ROAD, box, box)
    for panel, y, kind, text in (
        (left, -0.52, "good", "the centre is on the road"),
        (right, -0.85, "bad", "1, road: it has left the road"),
    ):
        panel.line([(-2.1, -0.6), (2.1, -0.6)], INK, width=1.1, style="--")
        panel.cars(pose(0.6, y, -8), names=False)
        panel.arrow(bend((-1.5, -0.3), (-0.7, -0.3), (0.6 - RHO, y + 0.02)), EGO_COLOUR)
        panel.line([(0.6, y), (0.6, y)], INK, width=3.5, order=9)
        panel.note(-1.2, -0.8, "2w from the\ncentre line", va="top")
        panel.title(text, kind)
    return figure


def lane() -> Figure:
    """Draw a car that keeps to its lane and one that reaches over the centre line."""
    box = (-2.1, -1.0, 2.1, 1.0)
    figure, (left, right) = row(ROAD, box, box)
    for panel, y in ((left, -0.16), (right, 0.1)):
        panel.cars(pose(0.7, y, 4), names=False)
        panel.line([(-2.1, 0.05), (2.1, 0.05)], BAD, width=1.1, style="--")
        panel.arrow(bend((-1.6, -0.3), (-0.5, -0.3), (0.7 - RHO, y - 0.02)), EGO_COLOUR)
        panel.note(-1.35, 0.28, "0.05 m over", colour="#A84300")
    left.title("the body stays in the right lane", "good")
    right.title("2, left: over, and not overtaking", "bad")
    return figure


def overtaking() -> Figure:
    """Draw the course of an overtaking, and one that does not come back."""
    figure, (upper, lower) = column(ROAD, STRIP, STRIP)
    block = 0.6
    for panel in (upper, lower):
        panel.band(block - 1.5, block + 0.8, -2 * W, 2 * W, "#F0E442")
        panel.note(-3.6, 0.85, "ego", colour=EGO_COLOUR, bold=True)
    for x in (block - 1.5, block, block + 0.8):
        upper.line([(x, -0.98), (x, -0.6)], FAINT, width=0.8)
    upper.span((block - 1.5, -0.8), (block, -0.8), "1.5 m", (block - 0.75, -0.98))
    upper.span((block, -0.8), (block + 0.8, -0.8), "0.8 m", (block + 0.4, -0.98))
    ego = pose(-3.6, LOW, 0)
    for panel in (upper, lower):
        panel.cars(ego, pose(block, LOW, 0), names=False)
        panel.note(block + 0.25, LOW, "A stands", ha="left")
    way = [(-3.4, LOW), (-0.75, LOW)]
    out = bend((-0.75, LOW), (-0.35, LOW), (-0.45, 0.32), (0.1, 0.32))
    upper.line(way, EGO_COLOUR, width=1.8)
    upper.line([*out, (1.3, 0.32)], GOOD, width=2.6, order=7)
    upper.line(bend((1.3, 0.32), (1.9, 0.32), (1.7, LOW), (2.4, LOW)), GOOD, width=2.6, order=7)
    upper.arrow([(2.4, LOW), (3.8, LOW)], EGO_COLOUR)
    upper.note(-2.2, -0.85, "blocked: overtaking begins")
    upper.line([(-1.25, -0.75), (-0.95, -0.35)], INK, width=0.8)
    upper.note(2.75, 0.85, "back, nothing blocks: it ends")
    upper.line([(2.3, 0.72), (2.2, -0.2)], INK, width=0.8)
    upper.title("left, but overtaking, and back within 10 s", "good")
    lower.line(way, EGO_COLOUR, width=1.8)
    lower.line([*out, (2.6, 0.32)], GOOD, width=2.6, order=7)
    lower.arrow([(2.6, 0.32), (3.9, 0.32)], BAD, width=2.6)
    lower.cross(2.6, 0.32)
    lower.note(2.6, 0.84, "left for 10 s", colour="#A84300")
    lower.title("2, return: the ego stays on the left", "bad")
    return figure


def stop() -> Figure:
    """Draw a stop before a crossing, and none."""
    box = (-2.75, -1.6, 2.0, 1.6)
    figure, (left, right) = row(STAR, box, box)
    for panel in (left, right):
        panel.disc()
        panel.approach(180)
    ego = inward(180, 0.12)
    left.cars(ego, names=False)
    left.arrow([(-2.7, LOW), (ego.x - RHO, LOW)], EGO_COLOUR)
    left.arrow([(ego.x + RHO, LOW), (0.4, LOW)], EGO_COLOUR, style=":")
    left.note(-2.65, -1.1, "stands 0.5 s in the\napproach: stopped,\nand has a ticket", ha="left")
    left.title("enters after a stop", "good")
    right.cars(pose(-0.75, LOW, 0), names=False)
    right.arrow([(-2.7, LOW), (-0.75 - RHO, LOW)], EGO_COLOUR)
    right.cross(-0.96, LOW)
    right.note(-2.65, -1.15, "rolls over the edge", ha="left")
    right.title("3, stop: enters without one", "bad")
    return figure


def order() -> Figure:
    """Draw four cars with tickets and their places, and an entry out of turn."""
    figure, (left, right) = row(STAR, HALF, HALF)
    gap = 0.1
    ego, first, second, last = (inward(bearing, gap) for bearing in BEARINGS)
    for panel in (left, right):
        panel.disc()
        panel.approach(0, 90, 180, 270)
    left.cars(ego, first, second, last, notes=[f"{tick / 30:.2f} s" for tick, _ in ARRIVALS])
    for p, (_, number) in zip((ego, first, second, last), ARRIVALS, strict=True):
        left.place(p, number)
    left.note(-2.45, 2.2, "tickets: when\neach stopped", ha="left")
    left.note(
        0.9,
        -1.85,
        "4.00 and 4.07 s are\none group: B goes\nbefore the ego, as it\nis on the ego's right",
        ha="left",
    )
    left.title("The order of arrival")
    right.cars(pose(W, -0.8, 90), outward(270, 0.55), second, last, names=False)
    right.note(-0.6, -2.25, "A has\ngone", ha="right", va="bottom")
    right.note(second.x + 0.25, second.y, "B", ha="left", bold=True)
    right.note(last.x - 0.25, last.y, "C", ha="right", bold=True)
    right.note(0.7, -1.05, "ego", ha="left", bold=True)
    right.arrow([(W, -1.9), (W, -0.8 - RHO)], EGO_COLOUR)
    right.place(second, 1)
    right.place(last, 3)
    right.cross(W, -0.98)
    right.note(0.75, -1.9, "was second,\nB ahead of it", ha="left")
    right.title("3, order: the ego enters before B", "bad")
    return figure


def clear() -> Figure:
    """Draw a wait for a car in the crossing, and an entry that does not wait."""
    box = (-2.75, -2.3, 2.75, 1.9)
    figure, (left, right) = row(STAR, box, box)
    ego = inward(270, 0.1)
    for panel in (left, right):
        panel.disc()
        panel.approach(270)
    tail = outward(0, -0.16)
    left.cars(ego, tail, names=False)
    left.place(ego, 1)
    left.arrow([(tail.x + RHO, tail.y), (tail.x + 0.8, tail.y)], "#A86F00")
    left.note(tail.x + 0.2, tail.y + 0.3, "A", bold=True)
    left.note(0.75, -1.55, "the ego is first, but\nA still meets the disc", ha="left")
    left.note(ego.x - 0.25, ego.y, "ego", ha="right", bold=True)
    left.title("waits until A is out", "good")
    other = pose(-0.35, LOW, 0)
    right.cars(pose(W, -0.84, 90), other, names=False)
    right.arrow([(other.x - 1.2, other.y), (other.x - RHO, other.y)], "#A86F00")
    right.arrow([(other.x + RHO, other.y), (other.x + 0.55, other.y)], "#A86F00", style=":")
    right.arrow([(W, -2.0), (W, -0.84 - RHO)], EGO_COLOUR)
    right.cross(W, -1.02)
    right.note(other.x, other.y + 0.32, "A", bold=True)
    right.note(0.6, -1.15, "ego", ha="left", bold=True)
    right.note(0.75, -1.55, "A is in the disc", ha="left")
    right.title("3, clear: enters beside A", "bad")
    return figure


def first_enters() -> Figure:
    """Draw a car that is first and does not go."""
    box = (-2.75, -2.3, 2.75, 1.5)
    figure, (left, right) = row(STAR, box, box)
    ego, other = inward(270, 0.1), inward(180, 0.1)
    for panel, places in ((left, (2, 1)), (right, (1, 2))):
        panel.disc()
        panel.approach(180, 270)
        panel.cars(ego, other, names=False)
        panel.note(ego.x - 0.25, ego.y, "ego", ha="right", bold=True)
        panel.note(other.x - 0.25, other.y, "A", ha="right", bold=True)
        panel.place(ego, places[0])
        panel.place(other, places[1])
    left.note(0.75, -1.7, "first, and nobody is\nin the crossing: A has\nto enter within 10 s", ha="left")
    left.title("E3: it is A's turn")
    right.note(0.75, -1.7, "not gone in 3 s: a\nnew ticket, now last;\nanother breaks E3", ha="left")
    right.title("E3: A has lost its turn")
    return figure


def free_exit() -> Figure:
    """Draw a car in a disc with one exit taken and one free."""
    box = (-2.75, -2.3, 2.75, 2.1)
    figure, (left, right) = row(STAR, box, box)
    inside = pose(-0.1, LOW, 0)
    near = outward(0, 0.3)
    for panel in (left, right):
        panel.disc()
    ego = inward(270, 0.1)
    left.cars(ego, inside, near, names=False)
    left.arrow([(inside.x + RHO, LOW), (near.x - RHO - 0.05, LOW)], BAD, style=":")
    left.cross(0.95, LOW)
    left.arrow(bend((inside.x + RHO, LOW), (W, LOW), (W, 1.75)), GOOD)
    left.note(W + 0.2, 1.5, "free: A has 5 s", ha="left", colour="#00684B")
    left.note(near.x - 0.1, LOW - 0.55, "B within 0.8 m:\nnot free", ha="left")
    around = (outward(0, 0.3), outward(90, 0.3), outward(180, 0.3), outward(270, 0.3))
    right.cars(ego, inside, *around, names=False)
    for x, y in ((0.93, LOW), (W, 0.93), (-0.93, W), (-W, -0.93)):
        right.cross(x, y)
    right.note(0.75, -1.75, "no exit is free:\nA may stay", ha="left")
    for panel in (left, right):
        panel.note(inside.x - 0.05, LOW + 0.32, "A", bold=True)
        panel.note(ego.x + 0.25, ego.y - 0.2, "ego", ha="left", bold=True)
    for name, p in zip("BCDE", around, strict=True):
        right.note(p.x + 0.22, p.y + 0.22, name, bold=True)
    left.title("E4: A must leave")
    right.title("E4 does not ask for it")
    return figure


def free_way() -> Figure:
    """Draw a car that lingers with a free way, and ones that a queue excuses."""
    figure, (upper, lower) = column(STAR, (-6.0, -1.15, 1.7, 1.15), (-6.0, -1.15, 1.7, 1.15))
    for panel in (upper, lower):
        panel.disc()
        panel.approach(180)
    stuck = pose(-4.1, LOW, 0)
    upper.band(stuck.x, stuck.x + 1.5, -2 * W, 0.0, "#F0E442")
    upper.cars(pose(-5.2, LOW, 0), stuck, names=False)
    upper.span((stuck.x, -0.75), (stuck.x + 1.5, -0.75), "1.5 m free", (stuck.x + 0.75, -0.93))
    upper.note(-5.2, 0.12, "ego", bold=True)
    upper.note(stuck.x, 0.12, "A", bold=True)
    upper.note(-3.6, 0.85, "nothing stands before A, and it holds no ticket")
    upper.title("E5: A lingers there for 60 s", "bad")
    front = inward(180, 0.08)
    line = [pose(front.x - 0.62 * n, LOW, 0) for n in range(3)]
    lower.cars(pose(-5.2, LOW, 0), *line, names=False)
    for name, p in zip(("A", "B", "C"), line, strict=True):
        lower.note(p.x, 0.12, name, bold=True)
    lower.note(-5.2, 0.12, "ego", bold=True)
    lower.note(-2.9, -0.9, "A waits with a ticket; B and C are in its queue")
    lower.title("E5 does not ask it of a queue", "good")
    return figure


def free_goal() -> Figure:
    """Draw a goal that is taken and one that is free."""
    box = (-2.75, -1.6, 2.2, 1.6)
    figure, (left, right) = row(STAR, box, box)
    for panel, other in ((left, pose(-0.1, LOW, 0)), (right, outward(0, 0.15))):
        panel.goal()
        ego = inward(180, 0.1)
        panel.cars(ego, other, names=False)
        panel.note(ego.x - 0.25, ego.y, "ego", ha="right", bold=True)
        panel.note(other.x, other.y + 0.3, "A", bold=True)
    left.note(-2.6, -1.1, "A's centre is in\nthe disc: at most\n60 s on end", ha="left")
    left.title("E6: the goal is taken")
    right.note(-2.6, -1.1, "no e-agent\nis at the goal", ha="left")
    right.title("free again", "good")
    return figure


def verdicts() -> Figure:
    """Draw the four verdicts as histories of the ego and of the environment."""
    figure = Figure(figsize=(6.9, 2.7), layout=None)
    axes = figure.add_axes((0.13, 0.02, 0.86, 0.96))
    rows = (
        ("satisfied", None, None, (1.2, 3.0, 5.1, 7.2, 9.0)),
        ("unfinished", None, None, (1.2, 3.0)),
        ("violated", 6.0, 8.0, (1.2, 3.0, 5.1)),
        ("excused", 6.0, 4.0, (1.2, 3.0, 5.1)),
    )
    for n, (name, fall, others, visits) in enumerate(rows):
        y = -1.3 * n
        for lift, end, colour in ((0.2, fall, EGO_COLOUR), (-0.2, others, AGENT_COLOURS[0])):
            for width, strength in ((10.0, 0.25), (end or 10.0, 0.75)):
                bar = Rectangle((0, y + lift - 0.14), width, 0.28, facecolor=colour, alpha=strength)
                bar.set_linewidth(0)
                axes.add_patch(bar)
            if end is not None:
                axes.plot([end], [y + lift], marker="X", markersize=10, color=BAD, markeredgecolor="white")
        axes.plot(visits, [y + 0.2] * len(visits), "o", color="white", markersize=4.5)
        axes.text(-0.2, y, name, ha="right", va="center", fontsize=9.5, fontweight="bold", color=INK)
        axes.text(10.15, y + 0.2, "ego", va="center", fontsize=8.5, color=INK)
        axes.text(10.15, y - 0.2, "environment", va="center", fontsize=8.5, color=INK)
    axes.add_patch(Rectangle((1.7, -4.89), 0.5, 0.28, facecolor=EGO_COLOUR, alpha=0.75, linewidth=0))
    axes.plot([1.95], [-4.75], "o", color="white", markersize=4.5)
    axes.text(2.4, -4.75, "visit of a goal", va="center", fontsize=8.5, color=INK)
    axes.plot([5.5], [-4.75], marker="X", markersize=10, color=BAD, markeredgecolor="white")
    axes.text(5.75, -4.75, "first breach", va="center", fontsize=8.5, color=INK)
    axes.set_xlim(-0.1, 11.7)
    axes.set_ylim(-5.0, 0.5)
    axes.axis("off")
    return figure


PICTURES: dict[str, Callable[[], Figure]] = {
    "ground": ground,
    "1-collision": collision,
    "1-road": road,
    "2-lane": lane,
    "2-overtaking": overtaking,
    "3-stop": stop,
    "3-order": order,
    "3-clear": clear,
    "E3-first-enters": first_enters,
    "E4-free-exit": free_exit,
    "E4-bend": free_bend,
    "E5-free-way": free_way,
    "E6-free-goal": free_goal,
    "verdicts": verdicts,
}


def main(folder: Path, suffix: str = ".svg") -> None:
    """Draw every picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in PICTURES.items():
        write(folder / (name + suffix), draw)


if __name__ == "__main__":
    parser = ArgumentParser(description="Draw the pictures of docs/task.md.")
    parser.add_argument("folder", nargs="?", type=Path, default=Path(__file__).parent, help="where to draw them")
    main(parser.parse_args().folder)
