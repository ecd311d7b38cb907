"""The propositions that formulas about the trials of a problem may use.

i stands for the name of a car, x and y for a lattice point. Beside those of the task (`specifications.task`) there are:

============================  ======================================================================================
``WORD_i``                    a flag of the car (`rules.propositions`), such as ``still_i``, ``blocked_i``; those of the
                              queue are about the crossing ahead
``cross_i_x_y``               the body meets the disc of the intersection
``enter_i_x_y``               it does and did not in the frame before; never in the first frame
``clear_i_x_y``               no other car crosses the intersection
``approach_i_x_y`` ...        of the queue at that crossing: also ``stopped``, ``ahead``, ``first``, ``forfeited``
``lane_i_x0_y0_x1_y1``        the lane state: on that segment, in that direction
``i_s_x0_y0_x1_y1``           the nearest segment, as the labels of 2016 say it
``free_x_y``                  no e-agent is at the intersection, goal or not
``visit_i_x_y``               a visit begins: the centre comes into the disc, for the first time or from another one
============================  ======================================================================================

``exit``, ``stays``, ``way`` (in a lane with a free way ahead, E5), ``overdue``, ``renewed`` and ``excess`` are there if
the problem asks for the rules; all but ``way`` only of e-agents.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from typing import Final, NamedTuple

from dubins_traffic.cars.state import EGO, NONE
from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.rules.judged import JudgedProblem
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.propositions import NAMES

OF_CAR: Final = (*NAMES, "collision", "at_fault")
OF_JUDGED: Final = ("way", "exit", "stays", "overdue", "renewed", "excess")
"""Propositions of problems that are judged by the rules only."""
OF_INTERSECTION: Final = ("cross", "enter", "clear", "visit")
OF_CROSSING: Final = ("approach", "stopped", "ahead", "first", "forfeited")
AT: Final = "at"
SEGMENT: Final = "segment"
LANE: Final = "lane"
FREE: Final = "free"
VISIT: Final = "visit"

_MOST_CARS: Final = 20
"""Most cars among whose propositions a name similar to an unknown one is looked for."""


class Proposition(NamedTuple):
    """A parsed proposition: `word` about the car with index `car` (-1: none) and a place.

    `place` is the number of an intersection, for `SEGMENT` of a segment and for `LANE` of a lane; -1 if there is none.
    """

    word: str
    car: int
    place: int


class Vocabulary:
    """The propositions of a problem.

    Parameters
    ----------
    problem : Problem
        The roads, and the parameters of the rules.
    names : sequence of str
        Names of the cars, the ego's first.
    """

    def __init__(self, problem: JudgedProblem, names: Sequence[str]) -> None:
        network = problem.network
        rules = RuleParameters.from_mapping(problem.rules)
        self._cars = {name: car for car, name in enumerate(names)}
        self._judged = bool(problem.rules)
        self._vertices = {point: v for v, point in enumerate(network.intersections)}
        self._crossings = {v for v, degree in enumerate(network.degrees) if degree >= rules.crossing_degree}
        self._segments = {segment: s for s, segment in enumerate(network.segments)}

    def __getitem__(self, name: str) -> Proposition:
        """Return what the proposition `name` says.

        Raises
        ------
        FormulaError
            If the problem has no such proposition, or the names of its cars let it be read in several ways.
        """
        readings = list(dict.fromkeys(self._readings(name)))
        if len(readings) > 1:
            expected = "cars whose names can't be taken for other propositions"
            raise FormulaError("ambiguous proposition", value=name, expected=expected)
        if not readings:
            expected = f"one of the problem's propositions, such as {self._like(name)}"
            raise FormulaError("unknown proposition", value=name, expected=expected)
        return readings[0]

    def _readings(self, name: str) -> Iterator[Proposition]:
        for word in (*OF_CAR, *(OF_JUDGED if self._judged else ())):
            car = self._car(name.removeprefix(f"{word}_"), name)
            if car is not None and (car != EGO or word not in OF_JUDGED[1:]):
                yield Proposition(word, car, NONE)
        place = re.fullmatch(r"(.+)_(\d+)_(\d+)", name)
        if place is not None:
            yield from self._at(place[1], self._vertices.get((int(place[2]), int(place[3])), NONE))
        line = re.fullmatch(r"(.+)_(\d+)_(\d+)_(\d+)_(\d+)", name)
        if line is not None:
            yield from self._along(line[1], (int(line[2]), int(line[3]), int(line[4]), int(line[5])))

    def _at(self, stem: str, vertex: int) -> Iterator[Proposition]:
        if vertex == NONE:
            return
        if stem == FREE:
            yield Proposition(FREE, NONE, vertex)
        car = self._car(stem.removesuffix("_t"), stem)
        if car is not None:
            yield Proposition(AT, car, vertex)
        for word in (*OF_INTERSECTION, *(OF_CROSSING if vertex in self._crossings else ())):
            car = self._car(stem.removeprefix(f"{word}_"), stem)
            if car is not None:
                yield Proposition(word, car, vertex)

    def _along(self, stem: str, line: tuple[float, float, float, float]) -> Iterator[Proposition]:
        segment = self._segments.get(line)
        car = self._car(stem.removesuffix("_s"), stem)
        if segment is not None and car is not None:
            yield Proposition(SEGMENT, car, segment)
        car = self._car(stem.removeprefix(f"{LANE}_"), stem)
        back = self._segments.get((line[2], line[3], line[0], line[1]))
        if car is not None and segment is not None:
            yield Proposition(LANE, car, 2 * segment)
        if car is not None and back is not None:
            yield Proposition(LANE, car, 2 * back + 1)

    def _car(self, rest: str, name: str) -> int | None:
        """Return the index of the car called `rest`; None if there is none, or if `rest` is all of `name`."""
        return None if rest == name else self._cars.get(rest)

    def _like(self, name: str) -> str:
        """Return the existing name that is most similar to `name`."""
        place = re.search(r"(_\d+_\d+)?$", name)
        end = place[0] if place else ""
        cars = list(self._cars)[:_MOST_CARS]
        if end:
            words = (*OF_INTERSECTION, *OF_CROSSING)
            known = [f"{word}_{car}{end}" for word in words for car in cars]
            known += [f"{car}_t{end}" for car in cars]
            known = [word for word in known if any(self._readings(word))]
        else:
            known = [f"{word}_{car}" for word in OF_CAR for car in cars]
        return next(iter(get_close_matches(name, known, 1, 0.0)), f"on_road_{cars[0]}")
