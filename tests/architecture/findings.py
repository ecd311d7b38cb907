"""What in the package is not as the house has it: each finding by a key, with a number or a reason."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping

import grimp

from tests.architecture.buildings import town
from tests.architecture.constants import constants
from tests.architecture.house import Findings, Module, modules
from tests.architecture.kernels import kernels_without_units, wide_kernels

MOST_LINES = 700
"""Lines of a module, where its noun is that large."""


def without_docstring() -> Findings:
    """Packages and modules without a docstring, and public classes and functions without one."""
    found: dict[str, str | int] = {}
    for module in modules():
        if not ast.get_docstring(module.tree):
            found[module.name or "dubins_traffic"] = "module"
        for item in module.definitions():
            told = ast.get_docstring(item) or is_overload(item)
            if not item.name.startswith("_") and is_at_top(module, item) and not told:
                found[f"{module.name}.{item.name}"] = "definition"
    return found


def is_overload(item: ast.AST) -> bool:
    """Whether a function is there for its types alone."""
    return any(isinstance(own, ast.Name) and own.id == "overload" for own in getattr(item, "decorator_list", ()))


def is_at_top(module: Module, item: ast.AST) -> bool:
    """Whether a class or function is one of the module's own, not of another class or function."""
    return item in module.tree.body


def long_modules() -> Findings:
    """Modules of too many lines."""
    counts = {module.name: module.text.count("\n") for module in modules()}
    return {name: count for name, count in counts.items() if count > MOST_LINES}


def imports_by_name() -> Findings:
    """Modules that a module names in a string and may not import: so it could import them unseen."""
    found_town = town()
    known = {module.name for module in modules()}
    found: dict[str, str | int] = {}
    for module in modules():
        room = module.name.partition(".")[0]
        for node in ast.walk(module.tree):
            text = node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
            named = re.fullmatch(r"dubins_traffic\.([\w.]+)(?::\w+)?", text)
            if named is None or named[1] not in known or room not in found_town.building:
                continue
            if not found_town.may_know(room, named[1].partition(".")[0]):
                found[f"{module.name} -> {named[1]}"] = "by a string"
    return found


def circles() -> Findings:
    """Circles among the parts of a package, at every depth: imports in functions and for types count."""
    graph = grimp.build_graph("dubins_traffic", cache_dir=None)
    found: dict[str, str | int] = {}
    for package in sorted(graph.modules):
        children = sorted(graph.find_children(package))
        part = {name: child for child in children for name in (child, *graph.find_descendants(child))}
        imports = {
            child: {
                part[target]
                for name, own in part.items()
                if own == child
                for target in graph.find_modules_directly_imported_by(name)
                if target in part and part[target] != child
            }
            for child in children
        }
        for circle in _components(imports):
            names = [name.removeprefix("dubins_traffic.") for name in circle]
            if not all("dubins_traffic_lcm" in name for name in names):
                found[" <-> ".join(names)] = len(names)
    return found


def _components(imports: Mapping[str, set[str]]) -> list[list[str]]:
    """Return the sets of nodes that reach each other, of two nodes or more."""

    def reached(start: str) -> set[str]:
        seen, waiting = set[str](), [start]
        while waiting:
            for target in imports[waiting.pop()] - seen:
                seen.add(target)
                waiting.append(target)
        return seen

    reach = {name: reached(name) for name in imports}
    groups = {
        tuple(sorted(other for other in reach[name] if name in reach[other])) for name in imports if name in reach[name]
    }
    return [list(group) for group in sorted(groups) if len(group) > 1]


CHECKS: Mapping[str, Callable[[], Findings]] = {
    "circles": circles,
    "constants": constants,
    "imports by name": imports_by_name,
    "kernels without units": kernels_without_units,
    "long modules": long_modules,
    "wide kernels": wide_kernels,
    "without docstring": without_docstring,
}
"""What is looked for, by name."""
