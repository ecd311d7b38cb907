"""Mealy machines in the Hanoi Omega-Automata format (HOA v1), as ltlsynt and other tools of SYNTCOMP write them.

Labels stand on edges; an edge holds inputs and outputs together. What is accepted does not matter: every play of a
machine is won. `controllable-AP` is not needed, as propositions are known by their names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, State, damaged

WHAT: Final = "HOA v1 with labels on its edges"
MOST_CUBES: Final = 4096
_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|/\*.*?\*/|@[\w-]+|[\w-]+:|\{[^}]*\}|[\w-]+|[\[\]()!&|]', re.DOTALL)
_Cube = dict[int, bool]


def is_hoa(text: str) -> bool:
    """Tell whether a text begins as HOA does."""
    return text.lstrip().startswith("HOA:")


def read_hoa(text: str) -> Explicit:
    """Return the machine in a text; InputError if it is none, or has labels elsewhere than on its edges."""
    head, found, rest = text.partition("--BODY--")
    body, ended, _ = rest.partition("--END--")
    if not found or not ended:
        raise damaged(WHAT, "--BODY-- or --END-- is missing")
    names, start = _header(head)
    edges: dict[State, list[Edge]] = {}
    state: int | None = None
    tokens = [token for token in _TOKEN.findall(body) if not token.startswith(("/*", "{", '"'))]
    place = 0
    while place < len(tokens):
        if tokens[place] == "State:":
            state, place = _number(tokens, place + 1), place + 2
            edges.setdefault(state, [])
        elif tokens[place] == "[" and state is not None:
            label = _Label(tokens, place + 1, len(names))
            cubes = label.read()
            target = _number(tokens, label.place)
            edges[state] += [Edge({names[k]: value for k, value in cube.items()}, target) for cube in cubes]
            place = label.place + 1
        else:
            raise damaged(WHAT, "not an edge with a label", value=tokens[place])
    if start not in edges:
        raise damaged(WHAT, "the state in which it starts is missing", value=start)
    return Explicit(edges, start, names)


def _header(text: str) -> tuple[list[str], int]:
    """Return the propositions and the initial state."""
    start = re.findall(r"^\s*Start:\s*(\d+)\s*$", text, re.MULTILINE)
    names = re.findall(r"^\s*AP:\s*(\d+)((?:\s+\"[^\"]*\")*)\s*$", text, re.MULTILINE)
    if len(start) != 1 or len(names) != 1:
        raise damaged(WHAT, "not one Start: and one AP:")
    found = re.findall(r'"([^"]*)"', names[0][1])
    if len(found) != int(names[0][0]):
        raise damaged(WHAT, "AP: with another number of names", value=names[0][0])
    return found, int(start[0])


def _number(tokens: list[str], place: int) -> int:
    if place >= len(tokens) or not tokens[place].isdigit():
        raise damaged(WHAT, "no state's number", value=tokens[place] if place < len(tokens) else None)
    return int(tokens[place])


class _Label:
    """Reads a label as cubes: what must hold of some propositions, by their numbers; any of them suffices."""

    def __init__(self, tokens: list[str], place: int, names: int) -> None:
        self.place = place
        self._tokens = tokens
        self._names = names

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
        return lambda wanted: _any(parts, True) if wanted else _all(parts, False)

    def _both(self) -> Callable[[bool], list[_Cube]]:
        parts = [self._literal()]
        while self._next() == "&":
            self.place += 1
            parts.append(self._literal())
        return lambda wanted: _all(parts, True) if wanted else _any(parts, False)

    def _literal(self) -> Callable[[bool], list[_Cube]]:
        token = self._next()
        self.place += 1
        if token == "!":
            inner = self._literal()
            return lambda wanted: inner(not wanted)
        if token == "(":
            found = self._either()
            self._take(")")
            return found
        if token in ("t", "f"):
            return lambda wanted: [{}] if wanted == (token == "t") else []
        if not token.isdigit() or int(token) >= self._names:
            raise damaged(WHAT, "not a label", value=token)
        return lambda wanted: [{int(token): wanted}]


def _any(parts: list[Callable[[bool], list[_Cube]]], wanted: bool) -> list[_Cube]:
    found = [cube for part in parts for cube in part(wanted)]
    return _bounded(found)


def _all(parts: list[Callable[[bool], list[_Cube]]], wanted: bool) -> list[_Cube]:
    found: list[_Cube] = [{}]
    for part in parts:
        found = _bounded(list(_met(found, part(wanted))))
    return found


def _met(cubes: list[_Cube], others: list[_Cube]) -> Iterator[_Cube]:
    for cube in cubes:
        for other in others:
            if all(cube.get(name, value) == value for name, value in other.items()):
                yield cube | other


def _bounded(cubes: list[_Cube]) -> list[_Cube]:
    if len(cubes) > MOST_CUBES:
        raise damaged(WHAT, "too long a label", value=f"{len(cubes)} cubes")
    return cubes
