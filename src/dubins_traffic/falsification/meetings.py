"""Bringing an e-agent to where it meets the ego soon: at the same crossing, behind it, ahead, or in the lane beside."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final

from dubins_traffic.agents import choices
from dubins_traffic.agents.choices import CHOICE
from dubins_traffic.cars.state import EGO
from dubins_traffic.falsification.standing import (
    Lots,
    far_off,
    lots_of,
    pose_at,
    spot_of,
    started,
    starts_of,
)
from dubins_traffic.problem.starts import gap_radius

if TYPE_CHECKING:
    import numpy as np

    from dubins_traffic.falsification.genome import Genome
    from dubins_traffic.problem.instance import Instance

COMES, LEAVES, LEADS = 0.55, 0.7, 0.9
"""Up to which share of the cars brought to the ego they come to its crossing, are behind it, or are ahead of the ego;
the others are in the lane beside."""
PAUSES: Final = 0.7
"""Share of the cars ahead of the ego, or behind its crossing, that pause there."""


def joined(genome: Genome, base: Instance, cars: tuple[int, ...], dice: np.random.Generator) -> Genome:
    """Return a genome of which one e-agent starts where it meets the ego soon; the same where that can't be.

    It starts on another arm of the intersection to which the ego drives first, about as far away; on a road that leads
    away from there; ahead of the ego in its lane; or in the lane beside. One that is in the ego's way may pause.

    Parameters
    ----------
    genome, base
        What is changed, and the instance of the number `genome.base`.
    cars
        The cars whose starts may be changed.
    dice
        What the change follows from.
    """
    others = [car for car in cars if car != EGO and _is_free(base, car)]
    if not others:
        return genome
    car = others[int(dice.integers(len(others)))]
    lots = lots_of(base)
    kind, near = dice.random(), far_off(dice)
    place = _place(genome, base, lots, kind, near, dice)
    if place is None:
        return genome
    starts = starts_of(genome, base)
    starts[car] = pose_at(lots, *place)
    if COMES <= kind < LEADS and car in genome.tables and dice.random() < PAUSES:
        table = genome.tables[car].copy()
        low, high = choices.BOUNDS[CHOICE.PAUSE].tolist()
        table[0, CHOICE.PAUSE], table[0, CHOICE.PAUSE_AT] = low + (high - low) * dice.random(), 0.0
        genome = replace(genome, tables={**genome.tables, car: table})
    return started(genome, base, starts, {car: starts[car]})


def _is_free(base: Instance, car: int) -> bool:
    """Tell whether a car may be on any lane."""
    return base.e_agents[car - 1].driver.parameters.get("goes") != "loop"


def _place(
    genome: Genome, base: Instance, lots: Lots, kind: float, near: float, dice: np.random.Generator
) -> tuple[int, float] | None:
    """Return the place where cars may start in which one meets the ego, and metres of its lane; None for none."""
    spot = spot_of(lots, genome.starts.get(EGO, base.starts[EGO]))
    if spot is None:
        return None
    (places, _, first, last, ends), (own, along) = lots, spot
    lane = places[own].lane
    vertex = ends[lane][1]
    if kind < LEAVES:
        end = 1 if kind < COMES else 0
        arms = [other for other in ends if other // 2 != lane // 2 and ends[other][end] == vertex]
        if not arms:
            return None
        arm = arms[int(dice.integers(len(arms)))]
        if kind < COMES:
            return last[arm], places[last[arm]].high - places[own].high + along + near
        return first[arm], places[first[arm]].low + abs(near)
    if kind < LEADS:
        return own, along + gap_radius(base.problem.car) + abs(near)
    beside = last.get(lane ^ 1)
    if beside is None:
        return None
    low, high = places[beside].low, places[beside].high
    return beside, low + (high - low) * dice.random()
