"""The answer for a problem: who wins, from where, under which assumption, why, and what would have to be stronger."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product
from time import perf_counter
from typing import Any, Final, Literal

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Instance
from dubins_traffic.synthesis.assumption import WORDS, Assumption, part_of
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.counter import Counterstrategy, story_of
from dubins_traffic.synthesis.game import Progress, build
from dubins_traffic.synthesis.instance import assumption_of, cells_of, start_positions
from dubins_traffic.synthesis.routes import route_bound
from dubins_traffic.synthesis.solver import Ranks, Solution, solve

STEPS = {"E3": ("E3:one-forfeit", "E3"), "E4": ("E4:unmet", "E4"), "E5": ("E5", "E5:moves-up")}
"""Words of a part from weak to strong, where more than one can be added."""
BENDS_ALONE = {"E4:unmet", "E5:moves-up"}
"""Words that make a difference only where there are bends or dead ends that are no crossings."""


def strengthenings(assumption: Assumption, count: int, *, bends: bool) -> Iterator[Iterator[Assumption]]:
    """Yield the assumptions in which `count` more parts are assumed, or assumed in full.

    Those with the same parts come together, the weak ones first. `bends`: whether there are any.
    """
    words = dict.fromkeys(part_of(word) for word in WORDS)
    word_of = {part_of(word): word for word in assumption.words()}
    ladders_of = {part: [*_ladder(part, word_of.get(part), bends)] for part in words}
    for parts in combinations((part for part in words if ladders_of[part]), count):
        ladders = [ladders_of[part] for part in parts]
        yield (
            Assumption.parse((word_of | dict(zip(parts, steps, strict=True))).values()) for steps in product(*ladders)
        )


def _ladder(part: str, word: str | None, bends: bool) -> Iterator[str]:
    """Yield the words of a part that are stronger than its own, the weak ones first."""
    steps = STEPS.get(part, (part,))
    for step in steps[steps.index(word) + 1 if word in steps else 0 :]:
        if bends or step not in BENDS_ALONE:
            yield step


def smallest(
    board: Board,
    wanted: Callable[[Solution], bool],
    *,
    limit: int | None = None,
    progress: Progress | None = None,
) -> list[Assumption]:
    """Return the assumptions with the fewest parts more under which the ego wins; none if it never does.

    Parameters
    ----------
    board : Board
        The game as it is lost.
    wanted : callable
        Says whether a solution is one in which the ego wins.
    limit, progress
        As for `game.build`.

    Raises
    ------
    InputError
        As `game.build`.
    """

    def wins(assumption: Assumption) -> bool:
        game = build(Board(board.road_cells, assumption, board.others), limit=limit, progress=progress)
        return wanted(solve(game, progress=progress))

    bends = not all(node.crossing for node in board.road_cells.nodes)
    parts = len({part_of(word) for word in WORDS})
    for count in range(1, parts + 1):
        ladders = strengthenings(board.assumption, count, bends=bends)
        tried = (next(filter(wins, steps), None) for steps in ladders)
        winning = [assumption for assumption in tried if assumption is not None]
        if winning:
            return winning
    return []


VACUOUSLY: Final = "vacuously"


@dataclass(frozen=True)
class Answer:
    """What synthesis says of an instance."""

    solution: Solution
    """Who wins from which position."""
    instance: Instance
    """Of which it says so."""
    route_bound: int
    """Against how many e-agents an ego on shortest routes is proved to win."""
    seconds: float
    """Wall-clock time taken."""
    limit: int | None = field(repr=False)
    """Bytes of memory that may be used."""

    @cached_property
    def starts(self) -> list[int]:
        """The positions in which the instance may start; none if that is not known."""
        return start_positions(self.solution.game.board, self.instance)

    @property
    def realizable(self) -> bool | Literal["vacuously"]:
        """Whether the ego wins from all positions in which the instance may start; if these aren't known, from all.

        ``"vacuously"`` where each of these wins is vacuous: the strategy, which keeps nobody from what is assumed,
        wins from none of them.
        """
        if not wins(self.solution, self.starts):
            return False
        vacuous = self.solution.vacuous
        return VACUOUSLY if bool((vacuous[self.starts] if self.starts else vacuous).all()) else True

    @property
    def outcome(self) -> str:
        """Where the ego wins: everywhere, from the starts, nowhere, or elsewhere only; vacuous or not."""
        if self.solution.everywhere:
            return "everywhere"
        if self.realizable:
            return "starts"
        return "elsewhere" if self.solution.winning.any() else "nowhere"

    def to_json(self) -> dict[str, Any]:
        """Return the answer for machines."""
        return {
            "states": self.solution.game.positions,
            "winning": int(self.solution.winning.sum()),
            "vacuous": int(self.solution.vacuous.sum()),
            "realizable": self.realizable,
            "route_bound": self.route_bound,
            "seconds": round(self.seconds, 3),
        }

    def lines(self) -> list[str]:
        """Return the answer for people."""
        game = self.solution.game
        board = game.board
        where = {
            "everywhere": "everywhere",
            "starts": "where the instance starts, but not everywhere",
            "elsewhere": "from some positions, but not where the instance starts",
            "nowhere": "nowhere",
        }[self.outcome]
        lines_of_text = [
            f"{_e_agents(board.others)}, {board.road_cells.cells} cells, crossings from degree "
            f"{board.road_cells.order_degree} on; assumed: {board.assumption}",
            f"{game.positions:,} positions, {game.moves:,} moves of the environment",
            f"The ego wins {where}.",
        ]
        if self.realizable == VACUOUSLY:
            lines_of_text.append(
                "It wins vacuously: each of these wins rests on an assumption that can't be kept then."
            )
        vacuous = int(self.solution.vacuous.sum())
        if vacuous:
            lines_of_text.append(
                f"Warning: in {vacuous:,} positions it wins only by bringing the e-agents to where they can't keep "
                "their assumption. The strategy never does so, and gives these positions up."
            )
        if self.route_bound > 0:
            lines_of_text.append(f"On shortest routes it is proved to win against up to {_e_agents(self.route_bound)}.")
        return lines_of_text

    def explain(self, progress: Progress | None = None) -> list[str]:
        """Return why the ego wins, or how it is stopped and what to assume so that it is not.

        InputError if a game that would have to be solved for it is too large.
        """
        if self.realizable is True:
            return [self._waits(target, ranks) for target, ranks in enumerate(self.solution.ranks)]
        if self.realizable == VACUOUSLY:
            return ["The ego has no strategy but to keep the e-agents from freeing a goal (E6)."]
        counter = Counterstrategy(self.solution)
        lost = ~self.solution.winning
        start = next((place for place in self.starts if lost[place]), int(np.argmax(lost)))
        board = self.solution.game.board

        def enough(solution: Solution) -> bool:
            return wins(solution, start_positions(solution.game.board, self.instance))

        better = smallest(board, enough, limit=self.limit, progress=progress)
        names = " or ".join(str(assumption) for assumption in better)
        return [
            *story_of(counter, start),
            f"The ego would win if this were assumed: {names}."
            if names
            else "The ego would not win even if all of E1 to E6 were assumed.",
        ]

    def _waits(self, target: int, ranks: Ranks) -> str:
        """Return in how many positions on the way to a target the ego gets on by itself or waits, and for what."""
        road_cells = self.solution.game.board.road_cells
        held = ranks.rank > 0
        debt = ranks.debt[ranks.rank[held]]
        nodes = len(road_cells.nodes)
        parts = {
            "gets nearer whatever the others do": debt < 0,
            "waits until one enters (E3, E5)": (debt >= nodes) & (debt < road_cells.cells),
            "waits until one leaves (E4)": (debt >= 0) & (debt < nodes),
            "waits until the goal is freed (E6)": debt >= road_cells.cells,
        }
        shares = ", ".join(f"{what} in {int(some.sum()):,}" for what, some in parts.items() if some.any())
        return f"On the way to {road_cells.target_name(target)} it {shares} positions."


def _e_agents(count: int) -> str:
    return f"{count} e-agent{'s' if count != 1 else ''}"


def wins(solution: Solution, starts: list[int]) -> bool:
    """Say whether the ego wins from these positions; from all, if there are none."""
    return bool(solution.winning[starts].all()) if starts else solution.everywhere


def answer(
    instance: Instance,
    *,
    cars: int | None = None,
    assumption: Assumption | None = None,
    order_degree: int | None = None,
    limit: int | None = None,
    progress: Progress | None = None,
) -> Answer:
    """Return what synthesis says of an instance.

    Parameters
    ----------
    cars : int, optional
        E-agents; those of the instance, if not given.
    assumption : Assumption, optional
        Of the e-agents; that of the instance's problem, if not given.
    order_degree : int, optional
        Least degree of a crossing; as the problem says, if not given.
    limit, progress
        As for `game.build`.

    Raises
    ------
    InputError
        As `game.build` and `RoadCells.of`.
    """
    begun = perf_counter()
    road_cells = cells_of(instance.problem, order_degree)
    others = len(instance.e_agents) if cars is None else cars
    board = Board(road_cells, assumption_of(instance.problem) if assumption is None else assumption, others)
    bound = route_bound(road_cells, board.assumption)
    try:
        game = build(board, limit=limit, progress=progress)
    except InputError as error:
        raise _with_bound(error, bound) from None
    return Answer(solve(game, progress=progress), instance, bound, perf_counter() - begun, limit)


def _with_bound(error: InputError, bound: int) -> InputError:
    """Return the refusal of a game that says what is known without it."""
    if bound <= 0:
        return error
    error.expected = f"{error.expected}; on shortest routes the ego is proved to win against up to {_e_agents(bound)}"
    return error
