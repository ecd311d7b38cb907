"""What is said once of many trials whose verdicts say little."""

from __future__ import annotations


def assumption_notice(broken: int, judged: int) -> str:
    """Return the notice on trials of which most have their assumption broken by the e-agents; else an empty text.

    Parameters
    ----------
    broken, judged : int
        In how many trials the assumption was broken, of how many that were judged.
    """
    if 2 * broken <= judged:
        return ""
    trials = "trial" if judged == 1 else "trials"
    verdicts = "this verdict says" if judged == 1 else "these verdicts say"
    return f"the assumption was broken in {broken} of {judged} {trials}: {verdicts} little"
