"""Can a set of obligations still be met? Answered on the Büchi automaton that the tableau is.

A state is the memory of the past operators and a set of obligations. An infinite run is accepting if it puts off no
until for ever; there is one from a state if it reaches a strongly connected component whose edges do not all put off
the same until (Couvreur, 1999).
"""

from __future__ import annotations

from typing import Final, TypeAlias

from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.logic.letters import Letter
from dubins_traffic.logic.moves import PUT_OFF, Stepper

MAX_STATES: Final = 20_000
"""Most states of the Büchi automaton of one part."""

State: TypeAlias = tuple[tuple[bool, ...], frozenset[int]]
Edge: TypeAlias = tuple[State, frozenset[int]]


class Emptiness:
    """Answers whether obligations can be met, for obligations without clocks; `most` states are looked at."""

    def __init__(self, stepper: Stepper, outcomes: list[tuple[bool, ...]], most: int = MAX_STATES) -> None:
        self._most = most
        self._stepper = stepper
        self._outcomes = outcomes
        self._meetable: dict[State, bool] = {}

    def meetable(self, memory: tuple[bool, ...], numbers: frozenset[int]) -> bool:
        """Say whether some infinite word meets all obligations in `numbers`.

        Raises
        ------
        FormulaError
            If the automaton grows too large.
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
        found = known.get(number)
        if found is None:
            node = self._stepper.table.nodes[number]
            if node.kind in ("test", "past"):
                values = letter.tests if node.kind == "test" else letter.past
                found = values[node.first] == node.strong
            elif node.kind in ("and", "or"):
                parts = (self._steady(part, letter, known) for part in node.parts)
                found = all(parts) if node.kind == "and" else any(parts)
            else:
                found = self._steady(node.parts[-1], letter, known) if node.parts else node.kind == "true"
            known[number] = found
        return found

    def _edges(self, state: State) -> list[Edge]:
        memory, numbers = state
        found: dict[Edge, None] = {}
        table = self._stepper.table
        for tests in self._outcomes:
            letter, after = table.letter(tests, memory)
            for move in self._stepper.step_all(sorted(numbers), letter):
                put_off = frozenset(atom >> 2 for atom in move if atom & PUT_OFF)
                found[(after, frozenset(atom >> 2 for atom in move)), put_off] = None
        return list(found)

    def _search(self, start: State) -> None:
        """Tarjan's algorithm from `start`, without recursion; settles every state that it meets."""
        index: dict[State, int] = {start: 0}
        low: dict[State, int] = {start: 0}
        edges: dict[State, list[Edge]] = {start: self._edges(start)}
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

    def _settle(self, component: list[State], edges: dict[State, list[Edge]]) -> None:
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
