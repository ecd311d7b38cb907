"""Colours that people with any kind of colour vision can tell apart (Okabe and Ito, 2008; Tol, 2021)."""

from __future__ import annotations

from typing import Final

EGO_COLOUR = "#0072B2"
AGENT_COLOURS = ("#E69F00", "#CC79A7", "#56B4E9", "#F0E442", "#882255", "#999933", "#44AA99")
GOAL_COLOUR = "#009E73"
GOAL_INK_COLOUR = "#00684B"
"""Of the names of goals."""
CONTACT_COLOUR = "#D55E00"
BREACH_COLOURS = ("#B3125F", "#8A6100")
"""Of the ego's breaches, and of the others'."""
GROUND_COLOUR = "#F6F5F1"
ROAD_COLOUR = "#CFD3D8"
KERB_COLOUR = "#AEB4BB"
LINE_COLOUR = "#FFFFFF"
HINT_COLOUR = "#9AA1A9"
OBSTACLE_COLOUR = "#6B5B4B"
INK_COLOUR = "#22272E"
FAINT_COLOUR = "#6E7681"

MAP: Final = {
    "ground": (GROUND_COLOUR, "#1A1E23"),
    "road": (ROAD_COLOUR, "#343B44"),
    "kerb": (KERB_COLOUR, "#4D5661"),
    "line": (LINE_COLOUR, "#76808C"),
    "hint": (HINT_COLOUR, "#737D89"),
    "goal": (GOAL_COLOUR, "#1FC294"),
    "goal-ink": (GOAL_INK_COLOUR, "#6FE3C1"),
    "contact": (CONTACT_COLOUR, "#FF8A3D"),
    "breach": (BREACH_COLOURS[0], "#FF6FB5"),
    "others": (BREACH_COLOURS[1], "#E5BD45"),
    "obstacle": (OBSTACLE_COLOUR, "#A08A73"),
    "edge": (INK_COLOUR, "#0B0D10"),
}
"""Colours of the map in the replay page, by the names of its style sheet: light and dark."""


def style_sheet() -> str:
    """Return the colours of the map as a style sheet, light and dark."""
    themes = [";".join(f"--{name}:{pair[k].lower()}" for name, pair in MAP.items()) for k in (0, 1)]
    return f':root{{{themes[0]}}}\n:root[data-theme="dark"]{{{themes[1]}}}\n'


def car_colour(index: int) -> str:
    """Return the colour of car `index` as ``#RRGGBB``: the ego's own, those of e-agents in turn."""
    return EGO_COLOUR if index == 0 else AGENT_COLOURS[(index - 1) % len(AGENT_COLOURS)]
