"""From a formula to a deterministic table with four verdicts (after Bauer, Leucker and Schallhart, TOSEM 2011).

A state is the memory of the past operators and what is left of the formula: a disjunction of sets of obligations. Its
verdict is *false* if no set can be met by any infinite continuation, *true* if the same holds of the negation, else
what the finite word so far satisfies when every next (and until) is strong and every weak next (and release) weak.

Where clocks run, what is left depends on their values too. A state can be met if it can when every clock has run as
unfavourably as may be, and can't if it can't under the most favourable values; where neither is so the verdict would
depend on the value of a clock, and the formula is refused in this form.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from dubins_traffic.kernels.arrays import Ints
from dubins_traffic.logic.formula import FUTURE, Formula, FormulaError, Op, subformulas
from dubins_traffic.logic.obligations import DONE, NOTHING, Atom, Letter, Moves, Node, Table

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
        moves = self._steps.get(key)
        if moves is None:
            moves = self._steps[key] = self._step(self.table.nodes[number], number, letter)
        return moves

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
        implied = self._implied.get(key)
        if implied is None:
            implied = self._implied[key] = self._implies(one, other)
        return implied

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
            rest = node.parts[0] if node.length == 1 else self.table.node(node._replace(length=node.length - 1))
        return frozenset([frozenset([rest << 2 | (STRONG if node.strong else 0)])])

    def _step_fixpoint(self, node: Node, number: int, letter: Letter) -> Moves:
        left, right = (self.step(part, letter) for part in node.parts)
        flags = STRONG if node.kind == "until" else 0
        if node.clock >= 0:
            if node.running and letter.expired >> node.clock & 1:
                return right
            rest = self.table.node(node._replace(running=2 if node.running else 1))
        elif node.length > 0:
            rest = node.parts[1] if node.length == 1 else self.table.node(node._replace(length=node.length - 1))
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


MAX_SOUGHT: Final = 20_000
"""Most states of the Büchi automaton of one part."""

SoughtState: TypeAlias = tuple[tuple[bool, ...], frozenset[int]]
Edge: TypeAlias = tuple[SoughtState, frozenset[int]]


class Emptiness:
    """Answers whether obligations can be met, for obligations without clocks; `most` states are looked at.

    It asks the Büchi automaton that the tableau is. A state is the memory of the past operators and a set of
    obligations. An infinite run is accepting if it puts off no until for ever; there is one from a state if it
    reaches a strongly connected component whose edges do not all put off the same until (Couvreur, 1999).
    """

    def __init__(self, stepper: Stepper, outcomes: list[tuple[bool, ...]], most: int = MAX_SOUGHT) -> None:
        self._most = most
        self._stepper = stepper
        self._outcomes = outcomes
        self._meetable: dict[SoughtState, bool] = {}

    def meetable(self, memory: tuple[bool, ...], numbers: frozenset[int]) -> bool:
        """Say whether some infinite word meets all obligations in `numbers`.

        FormulaError if the automaton grows too large.
        """
        state = memory, numbers
        if not numbers:
            return True
        if state not in self._meetable:
            if self._steadily(memory, numbers):
                self._meetable[state] = True
            else:
                self._search(state)
        return self._meetable[state]

    def _steadily(self, memory: tuple[bool, ...], numbers: frozenset[int]) -> bool:
        """Say whether one letter for ever meets the obligations; only asked where it leaves the memory as it is."""
        for tests in self._outcomes:
            letter, after = self._stepper.table.letter(tests, memory)
            if after == memory:
                known: dict[int, bool] = {}
                if all(self._steady(number, letter, known) for number in numbers):
                    return True
        return False

    def _steady(self, number: int, letter: Letter, known: dict[int, bool]) -> bool:
        """Return the value of an obligation on the word that repeats one letter."""
        steady = known.get(number)
        if steady is None:
            node = self._stepper.table.nodes[number]
            if node.kind in ("test", "past"):
                values = letter.tests if node.kind == "test" else letter.past
                steady = values[node.first] == node.strong
            elif node.kind in ("and", "or"):
                parts = (self._steady(part, letter, known) for part in node.parts)
                steady = all(parts) if node.kind == "and" else any(parts)
            else:
                steady = self._steady(node.parts[-1], letter, known) if node.parts else node.kind == "true"
            known[number] = steady
        return steady

    def _edges(self, state: SoughtState) -> list[Edge]:
        memory, numbers = state
        edges: dict[Edge, None] = {}
        table = self._stepper.table
        for tests in self._outcomes:
            letter, after = table.letter(tests, memory)
            for move in self._stepper.step_all(sorted(numbers), letter):
                put_off = frozenset(atom >> 2 for atom in move if atom & PUT_OFF)
                edges[(after, frozenset(atom >> 2 for atom in move)), put_off] = None
        return list(edges)

    def _search(self, start: SoughtState) -> None:
        """Tarjan's algorithm from `start`, without recursion; settles every state that it meets."""
        index: dict[SoughtState, int] = {start: 0}
        low: dict[SoughtState, int] = {start: 0}
        edges: dict[SoughtState, list[Edge]] = {start: self._edges(start)}
        path = [(start, iter(edges[start]))]
        stack = [start]
        while path:
            state, rest = path[-1]
            for target, _ in rest:
                if target in self._meetable:
                    continue
                if target in index:
                    low[state] = min(low[state], index[target])
                    continue
                if len(self._meetable) + len(index) > self._most:
                    raise FormulaError(
                        "too large to be monitored", expected=f"at most {self._most} states of its automaton"
                    )
                index[target] = low[target] = len(index)
                edges[target] = self._edges(target)
                stack.append(target)
                path.append((target, iter(edges[target])))
                break
            else:
                path.pop()
                if path:
                    low[path[-1][0]] = min(low[path[-1][0]], low[state])
                if low[state] == index[state]:
                    place = stack.index(state)
                    self._settle(stack[place:], edges)
                    del stack[place:]

    def _settle(self, component: list[SoughtState], edges: dict[SoughtState, list[Edge]]) -> None:
        members = set(component)
        always: frozenset[int] | None = None
        meetable = False
        for state in component:
            for target, put_off in edges[state]:
                if target in members:
                    always = put_off if always is None else always & put_off
                elif self._meetable[target] or not target[1]:
                    meetable = True
        meetable = meetable or (always is not None and not always)
        for state in component:
            self._meetable[state] = meetable


MAX_STATES: Final = 2048
"""Most states of one table before it is made smaller."""
MAX_CLOCKS: Final = 3
"""Most clocks of one table."""

FALSE: Final = 0
PRESUMABLY_FALSE: Final = 1
PRESUMABLY_TRUE: Final = 2
TRUE: Final = 3
VERDICTS: Final = ("false", "presumably false", "presumably true", "true")
"""The names of the verdicts, which are the numbers 0 to 3."""

State: TypeAlias = tuple[tuple[bool, ...], Moves]


@dataclass(frozen=True)
class Automaton:
    """A monitor as tables.

    Attributes
    ----------
    names : tuple of str
        The propositions; bit i of a valuation is the value of number i.
    letter : (2**P,) int64
        The letter of each valuation.
    target, reset : (S, L, 2**C) int64
        The next state, and which clocks start (bit set), by state, letter and which of the clocks have run out.
    verdict : (S,) int64
        See `VERDICTS`; state 0 is the first.
    clocks : (C,) int64
        Lengths, ticks: a clock that starts at tick t has run out at tick t + length.
    """

    names: tuple[str, ...]
    letter: Ints
    target: Ints
    reset: Ints
    verdict: Ints
    clocks: Ints


@dataclass(frozen=True, slots=True)
class Limits:
    """How large things may grow while a table is built.

    Attributes
    ----------
    states : int
        States of the table before it is made smaller.
    cells : int
        Its states times the letters and what is known of its clocks.
    sought : int
        States of the Büchi automaton in which it is asked what can still be met.
    choices : int
        Letters times the ways to meet or put off each operator other than G and X.
    """

    states: int = MAX_STATES
    cells: int = 1 << 30
    sought: int = MAX_SOUGHT
    choices: int = 1 << 62


FULL: Final = Limits()


def automaton(formula: Formula, period: float, unroll: int, limits: Limits = FULL) -> Automaton:
    """Return the table of one formula.

    Parameters
    ----------
    formula : Formula
        Not split further.
    period : float
        Seconds between positions.
    unroll : int
        Bounds up to this many ticks are counted in states, longer ones by clocks.
    limits : Limits
        What is too large.

    Raises
    ------
    FormulaError
        If the table would be too large, or the verdict would depend on the values of clocks, or one clock does not
        do for a bounded operator.
    """
    table = Table(period, unroll)
    table.add(formula)
    if len(table.clocks) > MAX_CLOCKS:
        raise FormulaError(
            "too many long bounds in one part", value=len(table.clocks), expected=f"at most {MAX_CLOCKS}"
        )
    return _Builder(table, formula, limits).build()


class _Builder:
    def __init__(self, table: Table, formula: Formula, limits: Limits) -> None:
        self._table = table
        self._limits = limits
        self._stepper = Stepper(table)
        self._letter, self._outcomes = table.letters()
        chosen = sum(part.op in FUTURE - {Op.G, Op.X} for part in subformulas(formula))
        if len(self._outcomes) << chosen > limits.choices:
            raise FormulaError("too many choices to be monitored", expected="fewer operators")
        self._emptiness = Emptiness(self._stepper, self._outcomes, limits.sought)
        self._verdicts: dict[State, int] = {}
        self._bounds: dict[tuple[int, bool], int] = {}

    def build(self) -> Automaton:
        table = self._table
        width = 1 << len(table.clocks)
        most = min(self._limits.states, self._limits.cells // (width * len(self._outcomes)))
        start = self._sunk((table.remembered(), frozenset([frozenset([table.root << 2])])))
        number = {start: 0}
        states = [start]
        rows: list[list[list[tuple[int, int]]]] = []
        for state in states:
            row: list[list[tuple[int, int]]] = []
            for tests in self._outcomes:
                cells: list[tuple[int, int]] = []
                for expired in range(width):
                    target, reset = self._step(state, tests, expired)
                    if target not in number:
                        if len(states) >= most:
                            raise FormulaError(
                                "too large to be monitored", expected=f"at most {most} states in each part"
                            )
                        number[target] = len(states)
                        states.append(target)
                    cells.append((number[target], reset))
                row.append(cells)
            rows.append(row)
        filled = np.array(rows, dtype=np.int64)
        verdict = np.array([self._verdict(state) for state in states], dtype=np.int64)
        return _reduced(table, self._letter, filled[..., 0], filled[..., 1], verdict)

    def _step(self, state: State, tests: tuple[bool, ...], expired: int) -> tuple[State, int]:
        memory, left = state
        if left in ((), DONE) or not left:
            return state, 0
        letter, after = self._table.letter(tests, memory, expired)
        moves: list[frozenset[Atom]] = []
        for conjunction in left:
            moves.extend(self._stepper.step_all(sorted({atom >> 2 for atom in conjunction}), letter))
        return self._started(after, self._stepper.smallest(moves))

    def _started(self, memory: tuple[bool, ...], moves: Moves) -> tuple[State, int]:
        """Return the state with clocks that have just started as running, and which those are."""
        nodes = self._table.nodes
        ages: dict[int, set[int]] = {}
        for atom in {atom for move in moves for atom in move}:
            node = nodes[atom >> 2]
            if node.clock >= 0 and node.running:
                ages.setdefault(node.clock, set()).add(node.running)
        if any(len(age) > 1 for age in ages.values()):
            raise FormulaError(
                "a bounded operator can be asked for again while it is pending, in a way that one clock can't follow",
                expected="shorter bounds, bounds from 0, or fewer operators inside each other",
            )
        reset = sum(1 << clock for clock, age in ages.items() if age == {1})
        changed = self._stepper.smallest(
            self._stepper.conjunction(frozenset(self._running(atom) for atom in move)) for move in moves
        )
        return self._sunk((memory, changed)), reset

    def _running(self, atom: Atom) -> Atom:
        node = self._table.nodes[atom >> 2]
        number = self._table.node(node._replace(running=2)) if node.running else atom >> 2
        return number << 2 | atom & STRONG

    def _sunk(self, state: State) -> State:
        """Return the one state for a final verdict, else `state` itself."""
        verdict = self._verdict(state)
        if verdict in (FALSE, TRUE):
            sink: State = (), (DONE if verdict == TRUE else frozenset())
            self._verdicts[sink] = verdict
            return sink
        return state

    def _verdict(self, state: State) -> int:
        verdict = self._verdicts.get(state)
        if verdict is None:
            verdict = self._verdicts[state] = self._judged(state)
        return verdict

    def _judged(self, state: State) -> int:
        memory, left = state
        if not self._meetable(memory, left):
            return FALSE
        if frozenset[int]() in left or not self._meetable(memory, self._negated(left)):
            return TRUE
        weak = any(not any(atom & STRONG for atom in conjunction) for conjunction in left)
        return PRESUMABLY_TRUE if weak else PRESUMABLY_FALSE

    def _negated(self, left: Moves) -> Moves:
        moves = DONE
        for conjunction in left:
            moves = self._stepper.both(
                moves, frozenset(frozenset([self._table.dual(atom >> 2) << 2]) for atom in conjunction)
            )
        return moves

    def _meetable(self, memory: tuple[bool, ...], moves: Moves) -> bool:
        if not self._table.clocks:
            numbered = (frozenset(atom >> 2 for atom in move) for move in moves)
            return any(self._emptiness.meetable(memory, numbers) for numbers in numbered)
        if any(self._emptiness.meetable(memory, self._replaced(move, False)) for move in moves):
            return True
        if any(self._emptiness.meetable(memory, self._replaced(move, True)) for move in moves):
            raise FormulaError(
                "its verdict depends on how far a long bound has run",
                expected="shorter bounds or simpler parts",
            )
        return False

    def _replaced(self, move: frozenset[Atom], kindly: bool) -> frozenset[int]:
        return frozenset(self._replace(atom >> 2, kindly) for atom in move)

    def _replace(self, number: int, kindly: bool) -> int:
        """Return an obligation without clocks that is implied by this one (`kindly`) or implies it."""
        key = number, kindly
        replaced = self._bounds.get(key)
        if replaced is not None:
            return replaced
        node = self._table.nodes[number]
        parts = tuple(self._replace(part, kindly) for part in node.parts)
        if node.kind in ("and", "or"):
            parts = tuple(sorted(set(parts)))
        changed = node._replace(parts=parts)
        if node.clock >= 0:
            changed = changed._replace(clock=-1, length=-1, running=0)
            if node.kind == "next":
                kind, left = ("until", self._table.true) if kindly else ("release", self._table.false)
                changed = changed._replace(kind=kind, parts=(left, parts[0]), strong=True)
            elif (node.kind == "until") != kindly:
                self._bounds[key] = parts[1]
                return parts[1]
        replaced = self._bounds[key] = self._table.node(changed)
        return replaced


def _reduced(table: Table, letter: Ints, target: Ints, reset: Ints, verdict: Ints) -> Automaton:
    """Merge states that behave alike (Moore's refinement), then letters that do."""
    states = len(verdict)
    block = verdict - verdict.min()
    count = 0
    while True:
        rows = np.concatenate([block[:, None], block[target].reshape(states, -1), reset.reshape(states, -1)], axis=1)
        _, first, block = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        block = block.reshape(-1)
        if len(first) == count:
            break
        count = len(first)
    order = np.concatenate([[block[0]], np.delete(np.arange(count), block[0])])
    place = np.empty(count, dtype=np.int64)
    place[order] = np.arange(count)
    kept = first[order]
    target, reset = place[block[target[kept]]], reset[kept]
    columns = np.concatenate([target, reset], axis=2).transpose(1, 0, 2).reshape(target.shape[1], -1)
    _, chosen, merged = np.unique(columns, axis=0, return_index=True, return_inverse=True)
    return Automaton(
        names=table.names,
        letter=merged.reshape(-1)[letter].astype(np.int64),
        target=np.ascontiguousarray(target[:, chosen]),
        reset=np.ascontiguousarray(reset[:, chosen]),
        verdict=verdict[kept],
        clocks=np.array(table.clocks, dtype=np.int64),
    )
