"""Watches a trial for its pages: each frame, breaches and whose turn it is at once, at the clock's pace."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from time import monotonic, sleep
from typing import Any, Final, Protocol

import numpy as np

from dubins_traffic.cars.state import EGO, Contact, Frames, Labels, Observation, Propositions, State
from dubins_traffic.controllers.navigator import Navigator, Situation
from dubins_traffic.live.show import Show
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.rules.referee import Referee
from dubins_traffic.scoring.verdict import Verdict, violation_of
from dubins_traffic.viewer.marks import (
    Mark,
    breach_marks,
    contact_mark,
    excuse_mark,
    verdict_text,
    visit_mark,
)
from dubins_traffic.viewer.replay import document_of, mark_of, origin_of, shown_summary

FALLEN_BEHIND: Final = 0.5
"""Seconds by which a trial may be late before the time that was lost is given up."""


class Pages(Protocol):
    """Those who show a feed."""

    def present(self, show: Show) -> None:
        """Show a trial from now on."""
        ...

    def ring(self) -> None:
        """Look for what is new in the log."""
        ...

    def wait(self) -> None:
        """Return when the trial may begin."""
        ...


class Feed:
    """A watcher that writes the log of each trial, and lets it run as fast as the clock.

    Parameters
    ----------
    pages : Pages
        Are told what is new.
    pace : float
        Seconds of the trial in a second.
    plays : bool
        Whether a person drives the ego.
    """

    def __init__(self, pages: Pages, pace: float = 1.0, *, plays: bool = False) -> None:
        self._pages, self._pace, self._plays = pages, pace, plays
        self._number = 0
        self._show: Show | None = None

    def begin(self, instance: Instance) -> None:
        """Begin a trial."""
        problem = instance.problem
        self._instance = instance
        self._period = problem.period / self._pace
        self._referee = Referee([instance]) if problem.rules else None
        self._navigator = Navigator(problem) if problem.rules else None
        self._goals = frozenset(problem.goal_vertices)
        self._origin = origin_of(problem)
        self._at = -1
        self._turn: Turn | None = None

    def watch(
        self,
        tick: int,
        state: State,
        labels: Labels,
        contacts: Sequence[Contact],
        observe: Callable[[], Observation],
    ) -> None:
        """Show frame `tick`, and return when the next is due."""
        show = self._begun(state, labels) if tick == 0 else self._show
        if show is None:
            return
        if tick:
            show.tick(tick, state, labels, self._origin)
        for mark in self._marks(tick, state, labels, contacts):
            show.tell({"kind": "mark", "mark": mark_of(mark, self._origin)})
        if self._navigator is not None:
            seen = observe()
            turn = turn_of(seen.propositions, self._navigator.look(seen))
            if turn != self._turn:
                self._turn = turn
                show.tell({"kind": "turn", "tick": tick, **asdict(turn)})
        self._pages.ring()
        self._pass_time(tick)

    def end(
        self,
        instance: Instance,
        ending: Ending | None,
        summary: Mapping[str, object],
        verdict: Verdict | None,
    ) -> None:
        """Tell how a trial ended (None: its record was cut off), its score, name to value, and the verdict."""
        told: dict[str, Any] = {
            "kind": "end",
            "ending": None if ending is None else {"end": ending.end.value, "detail": ending.detail},
            "summary": shown_summary(summary),
            "verdict": None,
        }
        if verdict is not None:
            mark = excuse_mark(instance, verdict)
            told["verdict"] = {"ruling": verdict.verdict.value, "why": verdict_text(verdict)}
            told["excuse"] = None if mark is None else mark_of(mark, self._origin)
        self.tell(told)

    def tell(self, message: dict[str, Any]) -> None:
        """Tell pages something about the present trial."""
        if self._show is not None:
            self._show.tell(message)
            self._pages.ring()

    def finish(self) -> None:
        """Tell nothing more of the present trial."""
        if self._show is not None:
            self._show.finish()
            self._pages.ring()

    def _begun(self, state: State, labels: Labels) -> Show:
        """Return the show of a trial whose cars have been placed, when its pages are there."""
        self._number += 1
        first = _block(self._instance.problem.rate, state, labels)
        document = document_of(self._instance, first, None)
        document["live"] = {
            "show": self._number,
            "frames": self._instance.ticks + 1,
            "pace": self._pace,
            "plays": self._plays,
        }
        self._show = show = Show(self._number, document)
        self._pages.present(show)
        return show

    def _marks(self, tick: int, state: State, labels: Labels, contacts: Sequence[Contact]) -> list[Mark]:
        instance = self._instance
        marks = [contact_mark(instance, contact) for contact in contacts]
        at = int(labels.at[0, EGO])
        if at != self._at and at in self._goals:
            marks.append(visit_mark(instance.problem, tick / instance.problem.rate, at))
        self._at = at
        if self._referee is not None:
            breaches = self._referee.update(tick, state, [contacts]) if tick else self._referee.reset(state)
            marks += breach_marks(instance, [violation_of(instance, breach) for breach in breaches[0]])
        return marks

    def _pass_time(self, tick: int) -> None:
        """Wait until the next tick is due; the clock starts when the pages are there."""
        if tick == 0:
            self._pages.wait()
            self._due = monotonic()
        self._due += self._period
        late = monotonic() - self._due
        if late < 0.0:
            sleep(-late)
        elif late > FALLEN_BEHIND:
            self._due += late


def _block(rate: float, state: State, labels: Labels) -> Frames:
    """Return frame 0 as a block, which shares the arrays."""
    asked = [np.zeros_like(state.x)] * 2
    return Frames(0, rate, *state[:6], *asked, *labels)


NEAR: Final = 1.5
"""Metres before the line from which a driver is told of a crossing."""


@dataclass(frozen=True, slots=True)
class Turn:
    """What the ego has to do at the crossing ahead, in a word (free, stop, wait, go) and in a sentence."""

    state: str
    text: str


FREE: Final = Turn("free", "")
"""Nothing: there is no crossing near."""


def turn_of(propositions: Propositions, here: Situation) -> Turn:
    """Return whose turn it is (docs/rules.md#queue), as far as the ego can see."""
    if here.stop_line <= 0.0 or not here.crossing or here.stop_line > NEAR:
        return FREE
    if not propositions.stopped:
        return Turn("stop", "Stop at the line before the crossing")
    if propositions.ahead:
        names = ", ".join(car.name for car in here.before) or "another car"
        return Turn("wait", f"Wait: {names} before you")
    if not propositions.clear:
        names = ", ".join(car.name for car in here.inside) or "another car"
        return Turn("wait", f"Wait: {names} in the crossing")
    return Turn("go", "Your turn: go")
