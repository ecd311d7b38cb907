"""The smallest strengthening of an assumption under which the ego wins."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, product

from dubins_traffic.synthesis.assumption import WORDS, Assumption, part_of
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import Progress, build
from dubins_traffic.synthesis.solver import Solution, solve

STEPS = {
    "E3": ("E3:one-forfeit", "E3"),
    "E4": ("E4:unmet", "E4"),
    "E5": ("E5", "E5:moves-up"),
}
"""Words of a part from weak to strong, where more than one can be added."""
BENDS_ALONE = {"E4:unmet", "E5:moves-up"}
"""Words that make a difference only where there are bends or dead ends that are no crossings."""


def strengthenings(assumption: Assumption, count: int, *, bends: bool) -> Iterator[Iterator[Assumption]]:
    """Yield the assumptions in which `count` more parts are assumed, or assumed in full.

    Those with the same parts come together, the weak ones first. `bends`: whether there are any.
    """
    words = dict.fromkeys(part_of(word) for word in WORDS)
    own = {part_of(word): word for word in assumption.words()}
    ladders_of = {part: [*_ladder(part, own.get(part), bends)] for part in words}
    for parts in combinations((part for part in words if ladders_of[part]), count):
        ladders = [ladders_of[part] for part in parts]
        yield (
            Assumption.parse((own | dict(zip(parts, steps, strict=True))).values())
            for steps in product(*ladders)
        )


def _ladder(part: str, own: str | None, bends: bool) -> Iterator[str]:
    """Yield the words of a part that are stronger than its own, the weak ones first."""
    steps = STEPS.get(part, (part,))
    for step in steps[steps.index(own) + 1 if own in steps else 0 :]:
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
        game = build(Board(board.arena, assumption, board.others), limit=limit, progress=progress)
        return wanted(solve(game, progress=progress))

    bends = not all(node.crossing for node in board.arena.nodes)
    parts = len({part_of(word) for word in WORDS})
    for count in range(1, parts + 1):
        ladders = strengthenings(board.assumption, count, bends=bends)
        tried = (next(filter(wins, steps), None) for steps in ladders)
        found = [assumption for assumption in tried if assumption is not None]
        if found:
            return found
    return []
