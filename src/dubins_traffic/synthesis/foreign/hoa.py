"""Mealy machines in the Hanoi Omega-Automata format (HOA v1), as ltlsynt and other tools of SYNTCOMP write them.

Labels stand on edges; an edge holds inputs and outputs together. What is accepted does not matter: every play of a
machine is won. `controllable-AP` says which propositions it answers; without it, nobody knows before it answers.
In a split machine, as Spot writes it with `spot-state-player`, an edge of a state of player 0 holds the inputs, and one
of the state of player 1 to which it leads the outputs; such a pair is joined to one edge.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import islice
from typing import Final

from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, Sides, State, damaged

WHAT: Final = "HOA v1 with labels on its edges"
MOST_NAMES: Final = 1024
"""Most propositions; a game has some dozens."""
MOST_CUBES: Final = 4096
"""Most cubes of a label."""
MOST_STEPS: Final = 1 << 24
"""Most pairs of cubes that are looked at, of all labels together."""
MOST_LITERALS: Final = 1 << 24
"""Most literals in the cubes of all edges."""
DEEPEST: Final = 50
"""Most brackets and negations of a label around each other."""
LONGEST: Final = 18
"""Most digits of a number."""
_TOKEN = re.compile(
    r'"(?:[^"\\]|\\(?:.|\Z))*(?:"|\Z)|/\*.*?(?:\*/|\Z)|@[\w-]+|[\w-]+:|\{[^}]*(?:\}|\Z)|[\w-]+|[\[\]()!&|]',
    re.DOTALL | re.ASCII,
)
"""A token; a text, a comment or a set that is not closed reaches to the end, so that each sign is looked at once."""
_Cube = dict[int, bool]


def is_hoa(text: str) -> bool:
    """Tell whether a text begins as HOA does."""
    return text.lstrip().startswith("HOA:")


def read_hoa(text: str) -> Explicit:
    """Return the machine in a text; InputError if it is none, or has labels elsewhere than on its edges."""
    head, has_body, rest = text.partition("--BODY--")
    body, ended, _ = rest.partition("--END--")
    if not has_body or not ended:
        raise damaged(WHAT, "--BODY-- or --END-- is missing")
    names, start, sides, players = _header(_tokens(head))
    edges = _Body([token for token in _tokens(body) if not token.startswith(('"', "{"))], names).edges()
    if start not in edges:
        raise damaged(WHAT, "the state in which it starts is missing", value=start)
    return Explicit(_joined(edges, start, players) if players else edges, start, names, sides)


def _joined(edges: dict[State, list[Edge]], start: int, players: list[int]) -> dict[State, list[Edge]]:
    """Return the edges of the states of player 0, each with one of the state of player 1 to which it leads."""
    whose: dict[State, int] = dict(enumerate(players))
    if set(whose) != set(edges):
        raise damaged(WHAT, "spot-state-player: not of each state", value=len(players))
    if whose[start] != 0:
        raise damaged(WHAT, "a machine that answers before it has read", value=start)
    joined: dict[State, list[Edge]] = {}
    literals = 0
    for state in (state for state in edges if whose[state] == 0):
        joined[state] = []
        for edge in edges[state]:
            if whose.get(edge.target) != 1:
                raise damaged(WHAT, "an edge that does not lead from player 0 to player 1", value=state)
            for answer in edges[edge.target]:
                if whose.get(answer.target) != 0:
                    raise damaged(WHAT, "an edge that does not lead from player 1 to player 0", value=edge.target)
                joined[state].append(Edge({**edge.cube, **answer.cube}, answer.target))
                literals += len(edge.cube) + len(answer.cube) + 1
                if literals > MOST_LITERALS:
                    raise damaged(WHAT, f"more than {MOST_LITERALS} literals on its edges")
    return joined


def _tokens(text: str) -> list[str]:
    """Return the tokens of a text without its comments."""
    return [token for token in _TOKEN.findall(text) if not token.startswith("/*")]


def _header(tokens: list[str]) -> tuple[list[str], int, Sides | None, list[int]]:
    """Return the propositions, the initial state, which propositions are read and answered, and the states' players.

    There are no players in a machine that is not split.
    """
    places = [place for place, token in enumerate(tokens) if token.endswith(":")]
    items = [
        (tokens[place], tokens[place + 1 : end]) for place, end in zip(places, [*places[1:], len(tokens)], strict=True)
    ]
    start = [values for key, values in items if key == "Start:"]
    names = [values for key, values in items if key == "AP:"]
    if len(start) != 1 or len(names) != 1:
        raise damaged(WHAT, "not one Start: and one AP:")
    if len(start[0]) != 1:
        raise damaged(WHAT, "not one state in which it starts", value=" ".join(start[0][:8]))
    count, names_of_props = _number(names[0], 0), [name.strip('"') for name in names[0][1:]]
    if len(names_of_props) != count or not all(name.startswith('"') for name in names[0][1:]):
        raise damaged(WHAT, "AP: with another number of names", value=count)
    if count > MOST_NAMES:
        raise damaged(WHAT, f"more than {MOST_NAMES} propositions", value=count)
    return (
        names_of_props,
        _number(start[0], 0),
        _sides(names_of_props, [item for key, item in items if key == "controllable-AP:"]),
        [_number(item, place) for key, item in items if key == "spot-state-player:" for place in range(len(item))],
    )


def _sides(names: list[str], lists: list[list[str]]) -> Sides | None:
    """Return which propositions are read and answered, by the lists of `controllable-AP`."""
    if not lists:
        return None
    numbers = {_number(lists[0], place) for place in range(len(lists[0]))}
    if len(lists) > 1 or any(number >= len(names) for number in numbers):
        raise damaged(WHAT, "not one controllable-AP: of its propositions", value=" ".join(lists[-1][:8]))
    answered = [names[number] for number in sorted(numbers)]
    return Sides([name for number, name in enumerate(names) if number not in numbers], answered)


def _number(tokens: list[str], place: int) -> int:
    token = tokens[place] if place < len(tokens) else ""
    if not token.isdigit() or len(token) > LONGEST:
        raise damaged(WHAT, "no state's number", value=token)
    return int(token)


class _Body:
    """Reads the states and their edges."""

    def __init__(self, tokens: list[str], names: list[str]) -> None:
        self._tokens = tokens
        self._names = names
        self._work = _Work()
        self._literals = 0

    def edges(self) -> dict[State, list[Edge]]:
        """Return the edges of each state."""
        edges: dict[State, list[Edge]] = {}
        state: int | None = None
        place = 0
        while place < len(self._tokens):
            if self._tokens[place] == "State:":
                state, place = _number(self._tokens, place + 1), place + 2
                edges.setdefault(state, [])
            elif self._tokens[place] == "[" and state is not None:
                edges_of_state, place = self._edges(place + 1)
                edges[state] += edges_of_state
            else:
                raise damaged(WHAT, "not an edge with a label", value=self._tokens[place])
        return edges

    def _edges(self, place: int) -> tuple[list[Edge], int]:
        """Return the edges of the label that begins at a token, and where the next token stands."""
        label = _Label(self._tokens, place, len(self._names), self._work)
        cubes = label.read()
        target = _number(self._tokens, label.place)
        self._literals += sum(map(len, cubes)) + len(cubes)
        if self._literals > MOST_LITERALS:
            raise damaged(WHAT, f"more than {MOST_LITERALS} literals on its edges")
        names = self._names
        edges = [Edge({names[k]: value for k, value in cube.items()}, target) for cube in cubes]
        return edges, label.place + 1


class _Work:
    """Counts the pairs of cubes that have been looked at: short labels may have long products."""

    def __init__(self) -> None:
        self._steps = 0

    def met(self, cubes: list[_Cube], others: list[_Cube]) -> list[_Cube]:
        """Return the cubes in which one of each holds."""
        self._steps += len(cubes) * len(others)
        if self._steps > MOST_STEPS:
            raise damaged(WHAT, "labels that take too long", value=f"{self._steps} pairs of cubes")
        pairs = (
            cube | other
            for cube in cubes
            for other in others
            if all(cube.get(name, value) == value for name, value in other.items())
        )
        return _bounded(list(islice(pairs, MOST_CUBES + 1)))


class _Label:
    """Reads a label as cubes: what must hold of some propositions, by their numbers; any of them suffices."""

    def __init__(self, tokens: list[str], place: int, names: int, work: _Work) -> None:
        self.place = place
        self._tokens = tokens
        self._names = names
        self._work = work
        self._depth = 0

    def read(self) -> list[_Cube]:
        """Return the cubes of a label, up to behind its bracket."""
        cubes = self._either()(True)
        self._take("]")
        return cubes

    def _take(self, token: str) -> None:
        if self._next() != token:
            raise damaged(
                WHAT,
                f"a label without {token}",
                value=" ".join(self._tokens[self.place - 3 : self.place + 3]),
            )
        self.place += 1

    def _next(self) -> str:
        return self._tokens[self.place] if self.place < len(self._tokens) else ""

    def _either(self) -> Callable[[bool], list[_Cube]]:
        parts = [self._both()]
        while self._next() == "|":
            self.place += 1
            parts.append(self._both())
        return lambda wanted: _any(parts, True) if wanted else self._all(parts, False)

    def _both(self) -> Callable[[bool], list[_Cube]]:
        parts = [self._literal()]
        while self._next() == "&":
            self.place += 1
            parts.append(self._literal())
        return lambda wanted: self._all(parts, True) if wanted else _any(parts, False)

    def _literal(self) -> Callable[[bool], list[_Cube]]:
        token = self._next()
        self.place += 1
        if token in ("!", "("):
            return self._around(token)
        if token in ("t", "f"):
            return lambda wanted: [{}] if wanted == (token == "t") else []
        if not token.isdigit() or len(token) > LONGEST or int(token) >= self._names:
            raise damaged(WHAT, "not a label", value=token)
        return lambda wanted: [{int(token): wanted}]

    def _around(self, token: str) -> Callable[[bool], list[_Cube]]:
        """Read what stands behind a negation or in brackets."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise damaged(WHAT, f"a label nested more than {DEEPEST} deep")
        if token == "!":
            inner = self._literal()
            self._depth -= 1
            return lambda wanted: inner(not wanted)
        cubes = self._either()
        self._take(")")
        self._depth -= 1
        return cubes

    def _all(self, parts: list[Callable[[bool], list[_Cube]]], wanted: bool) -> list[_Cube]:
        cubes: list[_Cube] = [{}]
        for part in parts:
            cubes = self._work.met(cubes, part(wanted))
        return cubes


def _any(parts: list[Callable[[bool], list[_Cube]]], wanted: bool) -> list[_Cube]:
    cubes = [cube for part in parts for cube in part(wanted)]
    return _bounded(cubes)


def _bounded(cubes: list[_Cube]) -> list[_Cube]:
    if len(cubes) > MOST_CUBES:
        raise damaged(WHAT, "too long a label", value=f"more than {MOST_CUBES} cubes")
    return cubes
