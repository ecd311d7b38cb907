"""The collisions of a trial."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from dubins_traffic.cars.state import EGO, Contact
from dubins_traffic.scoring.metric import Column, ScoreColumn


@dataclass(frozen=True, slots=True)
class Collision:
    """A contact of the ego with another body at `time` seconds, in the tick that ends in frame `tick`.

    `partner` names the other car, or is ``obstacle k``. `at_fault` tells whether the ego was at fault and
    `partner_at_fault` whether the other was; an obstacle never is.
    """

    time: float
    tick: int
    car: str
    partner: str
    at_fault: bool
    partner_at_fault: bool

    def to_json(self) -> dict[str, Any]:
        """Return the collision as a JSON object, with the key `with` for the partner."""
        return {
            "time": self.time,
            "tick": self.tick,
            "car": self.car,
            "with": self.partner,
            "at_fault": self.at_fault,
            "with_at_fault": self.partner_at_fault,
        }


def collisions_of(names: Sequence[str], contacts: Sequence[Contact]) -> tuple[tuple[Collision, ...], int]:
    """Return the collisions of the ego among `contacts`, in their order, and the number of those among others."""
    collisions: list[Collision] = []
    for contact in contacts:
        if EGO not in (contact.car, contact.other):
            continue
        fault, partner_fault = contact.at_fault
        other = contact.other
        if other == EGO:
            other, fault, partner_fault = contact.car, partner_fault, fault
        partner = names[other] if other >= 0 else f"obstacle {-1 - other}"
        collisions.append(Collision(contact.time, contact.tick, names[EGO], partner, fault, partner_fault))
    return tuple(collisions), len(contacts) - len(collisions)


def _faults(collisions: Sequence[Collision], *, ego: bool, other: bool) -> int:
    """Return how many collisions there are in which the ego is at fault or not, and the other is or not, as given."""
    return sum((one.at_fault, one.partner_at_fault) == (ego, other) for one in collisions)


COLUMNS = (
    ScoreColumn(Column("collisions", "collisions", "", -1, "int32"), lambda score: len(score.collisions)),
    ScoreColumn(
        Column("collisions_ego_fault", "collisions, the ego's fault", "", -1, "int32"),
        lambda score: _faults(score.collisions, ego=True, other=False),
    ),
    ScoreColumn(
        Column("collisions_other_fault", "collisions, the other's fault", kind="int32"),
        lambda score: _faults(score.collisions, ego=False, other=True),
    ),
    ScoreColumn(
        Column("collisions_both_fault", "collisions, the fault of both", "", -1, "int32"),
        lambda score: _faults(score.collisions, ego=True, other=True),
    ),
    ScoreColumn(
        Column("collisions_among_others", "collisions among others", kind="int32"),
        lambda score: score.collisions_among_others,
    ),
)
