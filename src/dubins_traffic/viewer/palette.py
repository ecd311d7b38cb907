"""Colours that people with any kind of colour vision can tell apart (Okabe and Ito, 2008; Tol, 2021)."""

from __future__ import annotations

EGO_COLOUR = "#0072B2"
AGENT_COLOURS = ("#E69F00", "#CC79A7", "#56B4E9", "#F0E442", "#882255", "#999933", "#44AA99")
GOAL_COLOUR = "#009E73"
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


def car_colour(index: int) -> str:
    """Return the colour of car `index` as ``#RRGGBB``: the ego's own, those of e-agents in turn."""
    return EGO_COLOUR if index == 0 else AGENT_COLOURS[(index - 1) % len(AGENT_COLOURS)]
