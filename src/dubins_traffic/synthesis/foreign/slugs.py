"""Strategies as slugs writes them: JSON (``--explicitStrategy --jsonOutput``), and text (``--explicitStrategy``).

A node holds the values of all propositions; the next node is one of its successors that has the inputs which are read.
gr1c writes JSON of the same form.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, Final

from dubins_traffic.synthesis.foreign.machine import Edge, Explicit, Sides, State, damaged

WHAT: Final = "slugs' JSON or its explicit text"
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
            key: ([bool(bit) for bit in node["state"]], list(node["trans"]))
            for key, node in document["nodes"].items()
        }
        initial = [key for key, node in document["nodes"].items() if node.get("initial")]
    except (KeyError, TypeError, AttributeError):
        raise damaged(WHAT, "not an object with variables and nodes") from None
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
                raise damaged(WHAT, "a state of other propositions", value=current, line=number)
            nodes[current] = ([value.strip() == "1" for _, _, value in pairs], [])
        elif following and current:
            nodes[current][1].extend(part.strip() for part in following[1].split(",") if part.strip())
        elif line.strip() and not line.strip().lower().startswith("with no successors"):
            raise damaged(WHAT, "not a state or its successors", value=line.strip()[:80], line=number)
    return _machine(names, nodes, [])


def _machine(
    names: Sequence[str],
    nodes: dict[str, tuple[list[bool], list[Any]]],
    initial: Sequence[str],
    sides: Sides | None = None,
) -> Explicit:
    """Return the machine of some nodes; without initial ones every node may be the first."""
    if not nodes:
        raise damaged(WHAT, "a strategy without states")
    into: dict[str, Edge] = {}
    for key, (values, _) in nodes.items():
        if len(values) != len(names):
            raise damaged(WHAT, "a state of other propositions", value=key)
        into[key] = Edge(dict(zip(names, values, strict=True)), key)
    edges: dict[State, list[Edge]] = {FIRST: [into[key] for key in initial or nodes]}
    for key, (_, following) in nodes.items():
        targets = [str(target) for target in following]
        unknown = [target for target in targets if target not in into]
        if unknown:
            raise damaged(WHAT, "a successor that is no state", value=unknown[0])
        edges[key] = [into[target] for target in targets]
    return Explicit(edges, FIRST, list(names), sides)
