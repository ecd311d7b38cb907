"""Strategies written out state by state: those of slugs and of TuLiP.

slugs writes JSON (``--explicitStrategy --jsonOutput``), and text (``--explicitStrategy``): a node holds the values of
all propositions; the next node is one of its successors that has the inputs which are read. gr1c writes JSON of the
same form. TuLiP's Python (`tulip.dumpsmach.python_case`) is read as text, never run.
"""

from __future__ import annotations

import ast
import re
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, Final

from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, Sides, State, damaged

SLUGS: Final = "slugs' JSON or its explicit text"
FIRST: Final = ("first",)
"""The state before the first letter, which no node is called."""
_STATE = re.compile(r"^State (\S+) with rank \S+ -> <([^>]*)>\s*$")
_FOLLOWING = re.compile(r"^\s*With successors\s*:\s*(.*)$")


def is_slugs_text(text: str) -> bool:
    """Tell whether a text is slugs' explicit one."""
    return _STATE.match(text.lstrip().partition("\n")[0]) is not None


def read_slugs_json(document: Any) -> Explicit:
    """Return the machine in a JSON object; InputError if it is none."""
    try:
        sides = None if document.get("variables") else _declared(document)
        names = [str(name) for name in (document["variables"] if sides is None else [*sides[0], *sides[1]])]
        nodes = {
            key: ([bool(bit) for bit in node["state"]], list(node["trans"])) for key, node in document["nodes"].items()
        }
        initial = [key for key, node in document["nodes"].items() if node.get("initial")]
    except (KeyError, TypeError, AttributeError):
        raise damaged(SLUGS, "not an object with variables and nodes") from None
    return _machine(names, nodes, initial, sides)


def _declared(document: Any) -> Sides:
    """Return the variables of gr1c's form, which are declared one by one for each side."""
    return Sides(*([str(name) for entry in document[side] for name in entry] for side in ("ENV", "SYS")))


def read_slugs_text(text: str) -> Explicit:
    """Return the machine in an explicit text; InputError if it is none."""
    nodes: dict[str, tuple[list[bool], list[Any]]] = {}
    names: list[str] = []
    current = ""
    for number, line in enumerate(text.splitlines(), 1):
        state, following = _STATE.match(line), _FOLLOWING.match(line)
        if state:
            current = state[1]
            pairs = [part.strip().rpartition(":") for part in state[2].split(",")]
            names = names or [name for name, _, _ in pairs]
            if [name for name, _, _ in pairs] != names:
                raise damaged(SLUGS, "a state of other propositions", value=current, line=number)
            nodes[current] = ([value.strip() == "1" for _, _, value in pairs], [])
        elif following and current:
            nodes[current][1].extend(part.strip() for part in following[1].split(",") if part.strip())
        elif line.strip() and not line.strip().lower().startswith("with no successors"):
            raise damaged(SLUGS, "not a state or its successors", value=line.strip()[:80], line=number)
    return _machine(names, nodes, [])


def _machine(
    names: Sequence[str],
    nodes: dict[str, tuple[list[bool], list[Any]]],
    initial: Sequence[str],
    sides: Sides | None = None,
) -> Explicit:
    """Return the machine of some nodes; without initial ones every node may be the first."""
    if not nodes:
        raise damaged(SLUGS, "a strategy without states")
    into: dict[str, Edge] = {}
    for key, (values, _) in nodes.items():
        if len(values) != len(names):
            raise damaged(SLUGS, "a state of other propositions", value=key)
        into[key] = Edge(dict(zip(names, values, strict=True)), key)
    edges: dict[State, list[Edge]] = {FIRST: [into[key] for key in initial or nodes]}
    for key, (_, following) in nodes.items():
        targets = [str(target) for target in following]
        unknown = [target for target in targets if target not in into]
        if unknown:
            raise damaged(SLUGS, "a successor that is no state", value=unknown[0])
        edges[key] = [into[target] for target in targets]
    return Explicit(edges, FIRST, list(names), sides)


TULIP: Final = "TuLiP's Python file"


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
        raise damaged(TULIP, "not as tulip.dumpsmach writes it") from None
    names = dict.fromkeys(name for out in edges.values() for edge in out for name in edge.cube)
    return Explicit(edges, first, list(names), Sides(list(read), [name for name in names if name not in read]))


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
