"""The notice that most verdicts of some trials mean little, since e-agents broke the assumption."""

from __future__ import annotations


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
    return f"the assumption was broken in {broken} of {judged} {trials}: {verdicts} little"
