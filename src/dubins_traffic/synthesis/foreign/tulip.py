"""Strategies as TuLiP writes them in Python (`tulip.dumpsmach.python_case`): read as text, never run."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Iterator
from typing import Final

from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, Sides, State, damaged

WHAT: Final = "TuLiP's Python file"


def is_tulip(text: str) -> bool:
    """Tell whether a text is of TuLiP's."""
    return text.startswith("class TulipStrategy")


def read_tulip(text: str) -> Explicit:
    """Return the machine in a file; nothing of it is run. InputError if it is not as TuLiP writes it."""
    try:
        (strategy,) = _parsed(text).body
        assert isinstance(strategy, ast.ClassDef)
        functions = {item.name: item for item in strategy.body if isinstance(item, ast.FunctionDef)}
        first = _initial(functions["__init__"])
        (choice,) = [item for item in functions["move"].body if isinstance(item, ast.If)]
        read: dict[str, None] = {}
        edges = {state: list(_edges(body, read)) for state, body in _cases(choice)}
    except (SyntaxError, ValueError, KeyError, AssertionError, AttributeError, RecursionError, MemoryError):
        raise damaged(WHAT, "not as tulip.dumpsmach writes it") from None
    names = dict.fromkeys(name for own in edges.values() for edge in own for name in edge.cube)
    return Explicit(
        edges, first, list(names), Sides(list(read), [name for name in names if name not in read])
    )


def _parsed(text: str) -> ast.Module:
    """Return the syntax tree of a text, of which Python has nothing to say but whether it is one."""
    with warnings.catch_warnings(action="ignore"):
        return ast.parse(text)


def _initial(function: ast.FunctionDef) -> State:
    for item in function.body:
        if isinstance(item, ast.Assign) and ast.unparse(item.targets[0]) == "self.state":
            return _value(item.value)
    raise ValueError("no initial state")


def _cases(choice: ast.If) -> Iterator[tuple[State, list[ast.stmt]]]:
    """Yield the states of a chain of ``if self.state == ...`` and what is done in each."""
    item: ast.stmt = choice
    while isinstance(item, ast.If):
        (name, state), *rest = _equations(item.test)
        assert name == "self.state"
        assert not rest
        yield state, item.body
        if len(item.orelse) != 1:
            return
        item = item.orelse[0]


def _edges(body: list[ast.stmt], read: dict[str, None]) -> Iterator[Edge]:
    """Yield the edges of a state, and note which propositions they read."""
    item = body[0]
    while isinstance(item, ast.If):
        cube = {name: bool(value) for name, value in _equations(item.test)}
        read.update(dict.fromkeys(cube))
        target: State = None
        for line in item.body:
            assert isinstance(line, ast.Assign)
            place = line.targets[0]
            if isinstance(place, ast.Subscript):
                assert isinstance(place.slice, ast.Constant)
                cube[str(place.slice.value)] = bool(_value(line.value))
            else:
                target = _value(line.value)
        yield Edge(cube, target)
        if len(item.orelse) != 1:
            return
        item = item.orelse[0]


def _equations(test: ast.expr) -> Iterator[tuple[str, int]]:
    """Yield names and values of ``(a == 1) and (b == 0)``."""
    if isinstance(test, ast.Constant) and test.value is True:
        return
    for part in test.values if isinstance(test, ast.BoolOp) else [test]:
        assert isinstance(part, ast.Compare)
        assert isinstance(part.ops[0], ast.Eq)
        yield ast.unparse(part.left), _value(part.comparators[0])


def _value(item: ast.expr) -> int:
    assert isinstance(item, ast.Constant)
    assert isinstance(item.value, int)
    return item.value
