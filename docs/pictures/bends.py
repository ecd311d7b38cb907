"""The picture of a bend, where the way back is no exit."""

from __future__ import annotations

from matplotlib.figure import Figure
from stage import ARM, BAD, RHO, W, bend, inward, outward, pose, row

from dubins_traffic.roads.network import RoadNetwork

BEND = RoadNetwork(((0, 0, 1, 0), (1, 0, 1, 1)), ARM, (-ARM, 0.0, 0.0), (2, 2))


def free_bend() -> Figure:
    """Draw a car in a bend whose exit is taken, and one with the ego in the disc, which came later."""
    box = (-3.6, -1.6, 1.6, 2.4)
    figure, (left, right) = row(BEND, box, box)
    inside = pose(-0.25, -W, 20)
    for panel in (left, right):
        panel.disc()
    ego = outward(90, 0.25)
    left.cars(ego, inside, names=False)
    left.arrow(bend((inside.x + RHO, inside.y), (W, -W), (W, ego.y - RHO - 0.1)), BAD, style=":")
    left.cross(W, 0.95)
    left.arrow(bend((inside.x - RHO, inside.y), (-0.6, 0.3), (-1.6, W)), BAD, style=":")
    left.cross(-0.95, W)
    left.note(-3.45, 1.6, "the ego's centre is within\n0.8 m, and the way back\nis no exit", ha="left")
    late = inward(180, -0.3)
    front = pose(W, 0.2, 80)
    right.cars(late, front, names=False)
    right.note(-3.45, 1.6, "the ego came into the disc\nafter A: A's seconds\ndo not count", ha="left")
    for panel, own, aside, down, other in ((left, ego, 0.5, 0.0, inside), (right, late, -0.45, 0.0, front)):
        panel.note(own.x + aside, own.y + down, "ego", bold=True)
        panel.note(other.x + 0.3, other.y - 0.2, "A", bold=True)
    left.title("E4: A may stay")
    right.title("E4: the clock stands")
    return figure
