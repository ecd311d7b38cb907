"""The trials of a search in which the ego got least done."""

from __future__ import annotations

from bisect import insort
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from dubins_traffic.falsification.case import Case, Story
from dubins_traffic.falsification.genome import Genome
from dubins_traffic.falsification.judging import judge
from dubins_traffic.falsification.trying import DONE, Tried

if TYPE_CHECKING:
    from dubins_traffic.falsification.crew import Crew
    from dubins_traffic.falsification.sampling import Source
    from dubins_traffic.scoring.score import Score

MOST: Final = 5
"""So many trials are kept."""


@dataclass(order=True, slots=True)
class _Kept:
    done: float
    number: int
    genome: Genome = field(compare=False)


class Least:
    """The `MOST` trials of a search in which the ego got least done while all others kept the assumption."""

    def __init__(self) -> None:
        self._kept: list[_Kept] = []

    def take(self, number: int, genome: Genome, tried: Tried) -> None:
        """Take what came of a trial."""
        if tried.discarded or tried.faulty:
            return
        insort(self._kept, _Kept(tried.margins[DONE], number, genome))
        del self._kept[MOST:]

    def cases(self, source: Source, crew: Crew) -> dict[str, Case]:
        """Return the trials as cases, by name, judged afresh; without those whose assumption does not hold."""
        found: dict[str, Case] = {}
        for instance in source.build([own.genome for own in self._kept]):
            judged = judge(instance, crew.make, crew.name)
            verdict = judged.score.verdict
            if verdict is None or verdict.assumption_broken:
                continue
            told = replace(_story(judged.score, crew.name), tick=judged.record.instance.ticks)
            found[f"{DONE}-{len(found) + 1}"] = Case(judged.record.instance, told)
        return found

    def state(self) -> Any:
        """Return what a search that is resumed needs, for JSON."""
        return [[own.done, own.number, own.genome.to_json()] for own in self._kept]

    def restore(self, state: Any) -> None:
        """Take over what `state` gave."""
        self._kept = [_Kept(done, number, Genome.from_json(own)) for done, number, own in state]


def _story(score: Score, name: str) -> Story:
    done = f"{score.counted_rounds} counted rounds, {score.goals_visited:.0%} of the goals"
    told = f"In {score.duration_s:g} s the ego got done {done} and {score.driven.distance_m:.1f} m."
    return Story(DONE, "driving", 0, name, score.duration_s, 0, told)
