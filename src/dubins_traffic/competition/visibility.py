"""What a participant may see of a submission: all that is shown comes from `visible`, and nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Final, Literal

from dubins_traffic.campaign.columns import SECOND
from dubins_traffic.competition.competition import Phase
from dubins_traffic.competition.judging import Judged
from dubins_traffic.competition.ranking import is_clean, is_cut, is_satisfied, missing, value

State = Literal["received", "checking", "queued", "running", "scoring", "done", "rejected", "failed", "cancelled"]
LONGEST_LOG = 4_000
"""Most characters of the log's tail that are shown with aggregates."""
OUR_FAULT: Final = "a fault of the platform: it runs again, and costs no quota"
_HIDDEN: Final[Mapping[str, str]] = {
    "received": "received",
    "checking": "received",
    "queued": "queued",
    "running": "queued",
    "scoring": "queued",
    "done": "finished",
    "failed": "finished",
    "rejected": "rejected",
    "cancelled": "cancelled",
}
"""What is said of each state where nothing of the trials is shown."""
_BEFORE_TRIALS = ("rejected", "cancelled")
"""States that no trial has led to: their reasons are told in every phase."""


@dataclass(frozen=True, slots=True)
class SubmissionState:
    """Where a submission is."""

    state: State
    """One of `State`."""
    reason: str = ""
    """Why it is there, for people."""
    owner: Literal["submission", "platform"] | None = None
    """Whose fault that is: ``submission``, ``platform``, or nobody's."""
    received: str | None = None
    """When it was received, UTC, ISO 8601."""
    place: int | None = None
    """Its place in the queue, from 1."""


def visible(
    phase: Phase, state: SubmissionState, results: Sequence[Judged] = (), *, now: datetime | None = None
) -> dict[str, Any]:
    """Return what the team of a submission may see of it, as a JSON object.

    Parameters
    ----------
    state : SubmissionState
        Where it is.
    results : sequence of Judged
        What has come of its trials so far.
    now : datetime, optional
        By default the present; once the phase has closed all is shown.

    Notes
    -----
    Before a phase that shows nothing has closed, the result does not depend on `results` but for whether one of them
    ended by a fault of the platform.
    """
    shows = "all" if phase.is_closed(now) else phase.shows
    if shows == "nothing":
        return _hidden(phase, state, results)
    document: dict[str, Any] = {**_head(phase, state), "state": state.state, "reason": state.reason}
    document |= {"owner": state.owner, "place": state.place}
    if shows == "aggregates":
        return {**document, **_aggregates(phase, state, results)}
    return {
        **document,
        "done": len(results),
        "of": len(phase.numbers),
        "summary": summary(phase, results),
        "trials": [result.to_json() for result in sorted(results, key=lambda result: result.number)],
    }


def tail(text: str, lines: int, longest: int = LONGEST_LOG) -> str:
    """Return the last lines of a text, cut to the last `longest` characters."""
    kept = text.splitlines()[-lines:] if lines else []
    return "\n".join(kept)[-longest:]


def _head(phase: Phase, state: SubmissionState) -> dict[str, Any]:
    return {"phase": phase.name, "shows": phase.shows, "received": state.received}


def _hidden(phase: Phase, state: SubmissionState, results: Sequence[Judged]) -> dict[str, Any]:
    """Return what may be seen of a submission whose trials are secret."""
    ours = state.owner == "platform" or any(result.owner == "platform" for result in results)
    before = state.state in _BEFORE_TRIALS
    return {
        **_head(phase, state),
        "state": _HIDDEN[state.state],
        "reason": OUR_FAULT if ours else state.reason if before else "",
        "owner": "platform" if ours else state.owner if before else None,
        "place": state.place if state.state == "queued" else None,
    }


def _aggregates(phase: Phase, state: SubmissionState, results: Sequence[Judged]) -> dict[str, Any]:
    """Return rounded aggregates over all trials, if they are done and enough, and a tail of one log."""
    document: dict[str, Any] = {"done": len(results), "of": len(phase.numbers), "summary": None}
    if state.state == "failed" and state.owner == "platform":
        document["reason"] = OUR_FAULT
    enough = len(phase.numbers) >= phase.model.least_trials
    if state.state == "done" and enough and not missing(results, phase):
        document["summary"] = summary(phase, results, phase.model.digits)
    ordered = sorted(results, key=lambda result: result.number)
    at_fault = [result for result in ordered if result.owner == "submission"]
    document["faults"] = sorted({result.end for result in at_fault})
    shown = (at_fault or ordered[-1:])[:1]
    document["log"] = tail(shown[0].log, phase.model.log_lines) if shown else ""
    return document


def summary(phase: Phase, results: Sequence[Judged], digits: int | None = None) -> dict[str, Any] | None:
    """Return how many trials count, and means over them, rounded to `digits`; None if none counts."""
    rows = [result.row for result in results if result.counts]
    if not rows:
        return None
    metric = phase.ranking.metric
    figures = {
        metric: sum(value(row, metric) for row in rows) / len(rows),
        SECOND: sum(value(row, SECOND) for row in rows) / len(rows),
        "satisfied": sum(map(is_satisfied, rows)) / len(rows),
        "clean": sum(map(is_clean, rows)) / max(1, len(rows) - sum(map(is_cut, rows))),
    }
    rounded = {name: number if digits is None else round(number, digits) for name, number in figures.items()}
    return {"trials": len(rows), **rounded}
