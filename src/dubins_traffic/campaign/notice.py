"""What is said once of many trials: that e-agents broke the assumption in most, and that some ended by a fault."""

from __future__ import annotations

from collections.abc import Mapping


def assumption_notice(broken: int, judged: int) -> str:
    """Return the notice if e-agents broke the assumption in most trials, else an empty text.

    Parameters
    ----------
    broken, judged : int
        Number of trials in which the assumption was broken, and of all that were judged.
    """
    if 2 * broken <= judged:
        return ""
    trials = "trial" if judged == 1 else "trials"
    verdicts = "this verdict says" if judged == 1 else "these verdicts say"
    says = f"e-agents broke what is assumed of them (E1 to E6) in {broken} of {judged} {trials}"
    return f"{says}: {verdicts} little about the controller"


def fault_notice(ends: Mapping[str, int], trials: int, first: str) -> str:
    """Return the notice that trials ended by a fault (`record.sink.FAULTS`) or came to nothing; empty if none did.

    Parameters
    ----------
    ends
        How many trials ended so, by each end.
    trials
        Number of all trials.
    first
        Which trial was the first of them, its end and the reason.
    """
    if not ends:
        return ""
    each = ", ".join(f"{count} {end}" for end, count in sorted(ends.items()))
    return f"{sum(ends.values())} of {trials} trials ended by a fault ({each}); the first: {first}"
