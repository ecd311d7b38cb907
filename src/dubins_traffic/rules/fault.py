"""Who is at fault in a collision (docs/rules.md#at-fault)."""

from __future__ import annotations

from dataclasses import replace

from dubins_traffic.cars.state import Contact
from dubins_traffic.kernels.arrays import Bits
from dubins_traffic.rules.propositions import FLAG


def in_breach(bits: int) -> bool:
    """Tell whether a car with the flags `bits` breaks rule 2 (left, not overtaking) or is in a disc against rule 3."""
    return bits & (FLAG.LEFT | FLAG.OVERTAKING) == FLAG.LEFT or bits & FLAG.BREACH3 != 0


def blamed(first: bool, second: bool, first_breaks: bool, second_breaks: bool) -> tuple[bool, bool]:
    """Return whether each of two cars is at fault, given whether each closed in and whether each is in breach."""
    first_guilty, second_guilty = first and first_breaks, second and second_breaks
    if first_guilty or second_guilty:
        return first_guilty, second_guilty
    return first, second


def with_fault(contact: Contact, bits: Bits) -> Contact:
    """Return `contact` with `at_fault` filled in.

    Norm: docs/rules.md#at-fault.

    Parameters
    ----------
    contact : Contact
        Who touched whom during a tick, how fast each closed, and who moved.
    bits : (N,) uint32
        The flags of the trial's cars in the frame at the beginning of that tick: all drivers chose from it.

    Notes
    -----
    A car that did not move is never at fault. A car that hits an obstacle is. Of two cars those that closed in are
    considered: if exactly one of these is in breach it alone is at fault, otherwise all of these are.
    """
    flags = int(bits[contact.car])
    return with_fault_by(contact, flags, int(bits[contact.other]) if contact.other >= 0 else 0)


def with_fault_by(contact: Contact, flags: int, other: int) -> Contact:
    """Do as `with_fault`, given the flags of `contact.car` and of the other car."""
    if contact.other < 0:
        return replace(contact, at_fault=(contact.moved[0], False))
    first, second = (moved and closing > 0.0 for moved, closing in zip(contact.moved, contact.closing, strict=True))
    return replace(contact, at_fault=blamed(first, second, in_breach(flags), in_breach(other)))
