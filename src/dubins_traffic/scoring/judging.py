"""Counts and judges one trial whose frames come in blocks, live or from a record."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from dubins_traffic.cars.near import unknown_spacing
from dubins_traffic.cars.state import EGO, Contact, Frames, Labels, State
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.records import table
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.problem.preconditions import check_demands
from dubins_traffic.record.sink import Ending
from dubins_traffic.roads.packing import pack
from dubins_traffic.rules.breach_log import EntryMargins
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import NOTHING, Referee
from dubins_traffic.scoring.collisions import collisions_of
from dubins_traffic.scoring.findings import Findings
from dubins_traffic.scoring.margins import EgoFrame, EgoMargins, margin_rules
from dubins_traffic.scoring.tally import Counted, count_frames, new_tally, tally_margins

if TYPE_CHECKING:
    from dubins_traffic.rules.referee import Breach
    from dubins_traffic.scoring.verdict import Verdict

NEVER = 1 << 62
"""A frame that no trial comes to."""


class Judging:
    """A sink that counts a trial and judges it if its problem carries rules.

    Breaches and faults are found again from the poses, so that every trial is judged by this code, whatever recorded
    it.

    Attributes
    ----------
    visits : list of (int, int)
        Frame and goal of each visit so far, in order; goals are numbered as in the document, each once.
    """

    def begin(self, instance: Instance) -> None:
        """Start without a frame.

        Raises
        ------
        InputError
            If the problem asks for the rules and they are not defined on its roads; the message names the place.
        """
        problem, cars = instance.problem, len(instance.names)
        self._instance = instance
        self._rules = RuleParameters.from_mapping(problem.rules)
        self._referee = None
        if problem.rules:
            self._check(problem)
            self._referee = Referee([instance])
        self._only: Ints = np.zeros(1, dtype=np.int64)
        self._counted = Counted(
            state=State.zeros(1, cars),
            labels=Labels.zeros(1, cars),
            roads=pack([problem.network], [problem.car.lane_width]),
            cars=pack_cars([problem.car]),
            obstacles=pack_obstacles([problem.obstacles]),
            spacing=unknown_spacing(1, cars),
            tally=new_tally([instance], self._only, cars),
        )
        self._count = bound(count_frames)
        self.visits: list[tuple[int, int]] = []
        self._breaches: list[Breach] = []
        self._contacts: list[Contact] = []
        self._seen: set[tuple[int, int]] = set()
        self._ending: Ending | None = None
        self._seal = NEVER
        self._last = -1

    def _check(self, problem: Problem) -> None:
        """Refuse roads on which the rules are not defined."""
        check_demands(
            problem.network,
            problem.intersection_radius,
            problem.car,
            problem.sensing_radius,
            self._rules.to_mapping(),
        )

    def frames(self, frames: Frames) -> None:
        """Count and judge a block of frames."""
        breaches, contacts = self._judged(frames)
        self._breaches += breaches
        self._contacts += contacts
        if not len(frames):
            return
        hits = [contact.tick for contact in contacts if EGO in (contact.car, contact.other)]
        of_ego = [breach.tick for breach in breaches if breach.car == EGO]
        if hits:
            self._counted.tally.trial[0].clearance = 0.0
        self._seal = min([self._seal, *hits, *of_ego])
        seen = self._counts(frames)
        self._seen.update(
            (one.car, one.tick) for one in breaches if one.car != EGO and seen[one.tick - frames.first, one.car]
        )
        self._last = frames.first + len(frames) - 1

    def _judged(self, frames: Frames) -> tuple[list[Breach], Sequence[Contact]]:
        """Return the breaches and contacts of a block of frames."""
        return ([], frames.contacts) if self._referee is None else self._referee.judge(frames)

    def _counts(self, frames: Frames) -> Ints:
        """Count a block; return which cars the ego senses in each of its frames, (F, N)."""
        tally = self._counted.tally
        needed, room = frames.first + len(frames), tally.ego.shape[1]
        if needed > room:
            longer: Any = table(EgoFrame, (1, needed))
            longer[:, :room] = tally.ego
            self._counted = self._counted.replace(tally=tally.replace(ego=longer))
        begun = np.zeros((len(frames), len(tally.goal)), dtype=np.int64)
        seen = np.zeros(frames.x.shape, dtype=np.int64)
        self._count(frames.first, self._seal, *frames.states, begun, seen, self._counted)
        self.visits += [(frames.first + f, goal) for f, goal in np.argwhere(begun).tolist()]
        return seen

    def end(self, ending: Ending) -> None:
        """Keep the ending: only a trial that ran its whole duration can be satisfied."""
        self._ending = ending

    def findings(self) -> Findings:
        """Return what has been found up to the last frame."""
        judged = self._referee if self._last >= 0 else None
        margins = table(EgoMargins, 1)
        if judged is not None:
            counted, rules = (
                self._counted,
                margin_rules([self._rules], [self._instance.problem.period], self._only),
            )
            count = np.array([self._last + 1])
            margins = tally_margins(self._only, count, counted.tally, rules, counted.roads, counted.cars)
        return Findings(
            instance=self._instance,
            rules=self._rules,
            ending=self._ending,
            last=self._last,
            tally=self._counted.tally,
            row=0,
            contacts=self._contacts,
            breaches=self._breaches,
            seen=self._seen,
            running=NOTHING if judged is None else judged.pending[0],
            margins=margins[0],
            entry=table(EntryMargins, 1)[0] if judged is None else judged.entries[0],
        )

    def result(self) -> Verdict | None:
        """Return the verdict up to the last frame, None if the problem carries no rules."""
        findings = self.findings()
        return findings.verdict(findings.visits, collisions_of(self._instance.names, self._contacts)[0])
