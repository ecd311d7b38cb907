"""The propositions of docs/rules.md that are flags, by the name under which rooms above the cars know them."""

from __future__ import annotations

from dubins_traffic.cars.propositions import FLAG, NAMES, names

__all__ = ["FLAG", "NAMES", "names", "renews_ticket"]


def renews_ticket(before: int, now: int) -> bool:
    """Tell whether a car that waits at a crossing has got another ticket since the frame before, by its flags in both.

    Who is first no more without a forfeit has kept its ticket: a car on its right has joined its group.
    """
    if not now & FLAG.FORFEITED:
        return False
    return not before & FLAG.FORFEITED or bool(before & FLAG.FIRST and not now & FLAG.FIRST)
