"""Steps of obligations over a letter, kept small by implication between obligations."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.logic.letters import Letter
from dubins_traffic.logic.obligations import DONE, NOTHING, Atom, Moves, Node, Table

MAX_MOVES: Final = 400
"""Most alternatives that one step may leave open."""

MAX_WORK: Final = 1_500_000
"""Most comparisons of alternatives while one table is worked out: some seconds."""

STRONG: Final = 1
PUT_OFF: Final = 2


class Stepper:
    """Steps the obligations of one table; remembers what it has worked out."""

    def __init__(self, table: Table) -> None:
        self.table = table
        self.work = 0
        self._steps: dict[tuple[int, Letter], Moves] = {}
        self._implied: dict[tuple[Atom, Atom], bool] = {}

    def step(self, number: int, letter: Letter) -> Moves:
        """Return what is left of obligation `number` after `letter`."""
        key = number, letter
        found = self._steps.get(key)
        if found is None:
            found = self._steps[key] = self._step(self.table.nodes[number], number, letter)
        return found

    def step_all(self, numbers: Iterable[int], letter: Letter) -> Moves:
        """Return what is left of several obligations after `letter`."""
        moves = DONE
        for number in numbers:
            moves = self.both(moves, self.step(number, letter))
            if not moves:
                break
        return moves

    def both(self, one: Moves, other: Moves) -> Moves:
        """Return the conjunction of two disjunctions."""
        if one == DONE:
            return other
        if other == DONE:
            return one
        return self.smallest(self.conjunction(a | b) for a in one for b in other)

    def either(self, one: Moves, other: Moves) -> Moves:
        """Return the disjunction of two disjunctions."""
        return self.smallest([*one, *other]) if one and other else one or other

    def conjunction(self, atoms: frozenset[Atom]) -> frozenset[Atom]:
        """Return `atoms` without those that others imply."""
        if len(atoms) < 2:
            return atoms
        return frozenset(
            atom for atom in atoms if not any(other != atom and self.implies(other, atom) for other in atoms)
        )

    def smallest(self, moves: Iterable[frozenset[Atom]]) -> Moves:
        """Return `moves` without those that imply another.

        Raises
        ------
        FormulaError
            If too many are left.
        """
        kept: list[frozenset[Atom]] = []
        for move in sorted(set(moves), key=len):
            self.work += 1 + len(kept)
            if not any(self._covers(other, move) for other in kept):
                kept = [other for other in kept if not self._covers(move, other)]
                kept.append(move)
        if len(kept) > MAX_MOVES or self.work > MAX_WORK:
            raise FormulaError(
                "too large to be monitored",
                expected=f"at most {MAX_MOVES} open alternatives, and {MAX_WORK} steps to work out the table",
            )
        return frozenset(kept)

    def _covers(self, weak: frozenset[Atom], strong: frozenset[Atom]) -> bool:
        return all(atom in strong or any(self.implies(other, atom) for other in strong) for atom in weak)

    def implies(self, one: Atom, other: Atom) -> bool:
        """Say whether one obligation contains another, as far as their form shows it."""
        key = one, other
        found = self._implied.get(key)
        if found is None:
            found = self._implied[key] = self._implies(one, other)
        return found

    def _implies(self, one: Atom, other: Atom) -> bool:
        if one >> 2 == other >> 2:
            return (one & 3) | (other & 3) == one & 3
        if (one & STRONG) < (other & STRONG):
            return False
        a, b = self.table.nodes[one >> 2], self.table.nodes[other >> 2]
        if a.kind != b.kind or a.parts != b.parts or a.kind not in ("until", "release"):
            return False
        shorter, longer = (a, b) if a.kind == "until" else (b, a)
        return _at_most(shorter, longer)

    def _step(self, node: Node, number: int, letter: Letter) -> Moves:
        if node.kind == "true":
            return DONE
        if node.kind == "false":
            return NOTHING
        if node.kind in ("test", "past"):
            values = letter.tests if node.kind == "test" else letter.past
            return DONE if values[node.first] == node.strong else NOTHING
        if node.kind == "and":
            return self.step_all(node.parts, letter)
        if node.kind == "or":
            moves = NOTHING
            for part in node.parts:
                moves = self.either(moves, self.step(part, letter))
            return moves
        if node.kind == "next":
            return self._step_next(node, letter)
        return self._step_fixpoint(node, number, letter)

    def _step_next(self, node: Node, letter: Letter) -> Moves:
        if node.clock >= 0:
            if node.running and letter.expired >> node.clock & 1:
                return self.step(node.parts[0], letter)
            rest = self.table.node(node._replace(running=2 if node.running else 1))
        else:
            rest = (
                node.parts[0] if node.length == 1 else self.table.node(node._replace(length=node.length - 1))
            )
        return frozenset([frozenset([rest << 2 | (STRONG if node.strong else 0)])])

    def _step_fixpoint(self, node: Node, number: int, letter: Letter) -> Moves:
        left, right = (self.step(part, letter) for part in node.parts)
        flags = STRONG if node.kind == "until" else 0
        if node.clock >= 0:
            if node.running and letter.expired >> node.clock & 1:
                return right
            rest = self.table.node(node._replace(running=2 if node.running else 1))
        elif node.length > 0:
            rest = (
                node.parts[1] if node.length == 1 else self.table.node(node._replace(length=node.length - 1))
            )
        else:
            rest = number
            flags |= PUT_OFF if node.kind == "until" else 0
        waiting: Moves = frozenset([frozenset([rest << 2 | flags])])
        if node.kind == "until":
            return self.either(right, self.both(left, waiting))
        return self.both(right, self.either(left, waiting))


def _at_most(shorter: Node, longer: Node) -> bool:
    """Say whether the first of two bounded fixpoints over the same parts certainly ends no later."""
    if longer.clock < 0 and longer.length < 0:
        return True
    if shorter.clock >= 0 and shorter.clock == longer.clock:
        return shorter.running >= longer.running
    return shorter.clock < 0 and longer.clock < 0 and 0 <= shorter.length <= longer.length
