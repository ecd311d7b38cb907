"""Finds which propositions of `rules.vocabulary` hold in which frame, from poses and contacts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO, Contact, Frames, Labels, State
from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.rules.exceptions import Exceptions
from dubins_traffic.rules.judged import JudgedInstance
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import FLAG, NAMES
from dubins_traffic.rules.referee import Referee
from dubins_traffic.rules.visits import visited_place, visits_in
from dubins_traffic.rules.vocabulary import (
    AT,
    FREE,
    LANE,
    OF_INTERSECTION,
    OF_JUDGED,
    SEGMENT,
    VISIT,
    Proposition,
    Vocabulary,
)

Mask = npt.NDArray[np.bool_]


class _Scene(NamedTuple):
    """What has been found in a block of frames, arrays (F, N); `bits` as in `Labels`."""

    at: Ints
    crosses: Ints
    segment: Ints
    lane: Ints
    bits: Ints
    touches: Mask
    guilty: Mask
    may_leave: Mask
    stays: Mask
    ways: Mask
    overdue: Mask
    renewed: Mask
    excess: Mask

    @staticmethod
    def empty(frames: int, cars: int) -> _Scene:
        def numbers() -> Ints:
            return np.zeros((frames, cars), dtype=np.int64)

        def masks() -> Mask:
            return np.zeros((frames, cars), dtype=np.bool_)

        return _Scene(
            at=numbers(),
            crosses=numbers(),
            segment=numbers(),
            lane=numbers(),
            bits=numbers(),
            touches=masks(),
            guilty=masks(),
            may_leave=masks(),
            stays=masks(),
            ways=masks(),
            overdue=masks(),
            renewed=masks(),
            excess=masks(),
        )


class Valuation:
    """Finds propositions in the frames of one trial, block by block from frame 0.

    Labels and faults are found again from the poses, as the referee does; those in a record are not used.

    Parameters
    ----------
    instance : Instance
        The trial.
    names : sequence of str
        The propositions wanted.

    Raises
    ------
    FormulaError
        If the problem has no proposition of one of these names.
    """

    def __init__(self, instance: JudgedInstance, names: Sequence[str]) -> None:
        problem = instance.problem
        vocabulary = Vocabulary(problem, instance.names)
        self._wanted = [vocabulary[name] for name in names]
        self._rules = RuleParameters.from_mapping(problem.rules)
        self._labeller = Labeller([instance])
        judged = any(proposition.word in OF_JUDGED for proposition in self._wanted)
        self._referee = Referee([instance], self._labeller) if judged else None
        self._asks_for_ways = any(proposition.word == "way" for proposition in self._wanted)
        self._visits = {wanted: visited_place(wanted.place) for wanted in self._wanted if wanted.word == VISIT}
        self._exceptions = Exceptions(self._rules, problem.rate)
        network = problem.network
        self._ends = np.array([network.lane_ends(lane)[1] for lane in range(network.lanes)] + [-1])
        self._state = State.zeros(1, len(instance.names))
        self._next = 0

    def values(self, frames: Frames) -> Mask:
        """Return which of the propositions hold in each frame of the next block, (F, P).

        Raises
        ------
        ValueError
            If frames have been left out.
        """
        if frames.first != self._next:
            raise ValueError(f"frame {self._next} must follow, got {frames.first}")
        self._next += len(frames)
        scene = self._scene(frames)
        values = np.zeros((len(frames), len(self._wanted)), dtype=np.bool_)
        for column, proposition in enumerate(self._wanted):
            values[:, column] = self._value(scene, proposition)
        return values

    def _scene(self, frames: Frames) -> _Scene:
        contacts: dict[int, list[Contact]] = {}
        for contact in frames.contacts:
            contacts.setdefault(contact.tick, []).append(contact)
        scene = _Scene.empty(len(frames), frames.x.shape[1])
        for row in range(len(frames)):
            tick = frames.first + row
            for name in ("x", "y", "c", "s"):
                getattr(self._state, name)[0] = getattr(frames, name)[row]
            of_labels = self._label(tick, contacts.get(tick, []))
            self._note(scene, row, tick, of_labels)
        return scene

    def _label(self, tick: int, contacts: Sequence[Contact]) -> Sequence[Contact]:
        if tick == 0:
            self._labeller.reset(self._state)
            return contacts
        return self._labeller.update(tick, self._state, [contacts])[0]

    def _note(self, scene: _Scene, row: int, tick: int, contacts: Sequence[Contact]) -> None:
        labels: Labels = self._labeller.labels
        for name in ("at", "crosses", "segment", "lane", "bits"):
            getattr(scene, name)[row] = getattr(labels, name)[0]
        for contact in contacts:
            for car, guilty in zip((contact.car, contact.other), contact.at_fault, strict=True):
                if car >= 0:
                    scene.touches[row, car] = True
                    scene.guilty[row, car] |= guilty
        if self._referee is None:
            return
        if tick == 0:
            breaches = self._referee.reset(self._state)[0]
        else:
            breaches = self._referee.update(tick, self._state, [contacts])[0]
        scene.may_leave[row] = self._referee.may_leave[0]
        scene.stays[row] = self._referee.stays[0]
        scene.overdue[row] = self._referee.overdue[0]
        if self._asks_for_ways:
            scene.ways[row] = self._referee.ways(self._state)[0]
        over = self._labeller.forfeits[0] == self._rules.tickets + 1
        scene.renewed[row] = over & (self._labeller.tickets[0] == tick)
        for breach in breaches:
            of_e1 = breach.car != EGO and not breach.rule.startswith("E")
            if of_e1 and self._exceptions.exceeded(breach):
                scene.excess[row, breach.car] = True

    def _value(self, scene: _Scene, wanted: Proposition) -> Mask:
        word, car, place = wanted
        if word == FREE:
            return ~(scene.at[:, EGO + 1 :] == place).any(axis=1)
        if word in OF_INTERSECTION:
            return self._of_intersection(scene, wanted)
        if word in NAMES:
            flag = scene.bits[:, car] & NAMES[word] != 0
            return flag if place < 0 else flag & (self._ends[scene.lane[:, car]] == place)
        masks = {"collision": scene.touches, "at_fault": scene.guilty, "exit": scene.may_leave}
        masks |= {
            "stays": scene.stays,
            "way": scene.ways,
            "overdue": scene.overdue,
            "renewed": scene.renewed,
            "excess": scene.excess,
        }
        if word in masks:
            return masks[word][:, car]
        return {AT: scene.at, SEGMENT: scene.segment, LANE: scene.lane}[word][:, car] == place

    def _of_intersection(self, scene: _Scene, wanted: Proposition) -> Mask:
        word, car, place = wanted
        if word == VISIT:
            return visits_in(scene.at[:, car], self._visits[wanted]) != 0
        if place < 0:
            return scene.bits[:, car] & NAMES[word] != 0
        crosses = scene.crosses == place
        if word == "clear":
            return ~np.delete(crosses, car, axis=1).any(axis=1)
        if word == "enter":
            return crosses[:, car] & (scene.bits[:, car] & FLAG.ENTERED != 0)
        return crosses[:, car]
