"""What in the package is not as the house has it: each finding by a key, with a number or a reason."""

from __future__ import annotations

import ast
import builtins
import keyword
import re
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence

import grimp

from tests.architecture.constants import constants
from tests.architecture.house import Findings, Module, modules
from tests.architecture.kernels import kernels_without_units, wide_kernels

MOST_LINES = 350
"""Lines of a module."""
MOST_OF_A_FUNCTION = 50
"""Lines of a function."""
SAME_LINES = 6
"""So many lines of code that are the same in two places should be one."""


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


RETIRED_MODULES = _words("""
    asked told course course_over course_run course_watch docket desk lanes_desk late coasting kept_ways holding calm
    patch guard gates law law_tables paving tallied programme many work conduct orphans warm sheets weave growth pieces
    demands utils
""")
"""Names of modules that the field's words have replaced; docs/glossary.md says by which."""
RETIRED_CLASSES = _words("""
    Asked Told Seats Course Docket Terms Desk Guard Guards Way Paving Tallied Running Programme
""")
RETIRED_FUNCTIONS = _words("""
    asked told course conduct late put_off catch_up mind_gate law weave sheets pave
""")


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
    return any(
        isinstance(own, ast.Name) and own.id == "overload" for own in getattr(item, "decorator_list", ())
    )


def is_at_top(module: Module, item: ast.AST) -> bool:
    """Whether a class or function is one of the module's own, not of another class or function."""
    return item in module.tree.body


def retired_names() -> Findings:
    """Modules, classes and functions that are named by a word that has been retired."""
    found: dict[str, str | int] = {}
    for module in modules():
        words = set(module.name.split("."))
        if words & RETIRED_MODULES and "cli" not in words:  # commands keep their names
            found[module.name] = "module"
        for item in module.definitions():
            retired = RETIRED_CLASSES if isinstance(item, ast.ClassDef) else RETIRED_FUNCTIONS
            if item.name.strip("_") in retired:
                found[f"{module.name}.{item.name}"] = "definition"
    return found


def long_modules() -> Findings:
    """Modules of too many lines."""
    counts = {module.name: module.text.count("\n") for module in modules()}
    return {name: count for name, count in counts.items() if count > MOST_LINES}


def long_functions() -> Findings:
    """Functions of too many lines, their docstrings not counted."""
    found: dict[str, str | int] = {}
    for module in modules():
        for own in module.definitions():
            if isinstance(own, ast.ClassDef):
                continue
            said = own.body[0] if ast.get_docstring(own) else None
            lines = _lines(own) - (0 if said is None else _lines(said))
            if lines > MOST_OF_A_FUNCTION:
                found[f"{module.name}.{own.name}"] = lines
    return found


def _lines(node: ast.stmt) -> int:
    return (node.end_lineno or node.lineno) - node.lineno + 1


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
        tuple(sorted(other for other in reach[name] if name in reach[other]))
        for name in imports
        if name in reach[name]
    }
    return [list(group) for group in sorted(groups) if len(group) > 1]


def duplicates() -> Findings:
    """Runs of `SAME_LINES` lines of code or more that do the same in two places.

    Layout and comments don't matter, nor what variables are called: they are numbered within a run.
    """
    lines = [(module.name, line) for module in modules() for line in _code(module)]
    texts = [line for _, line in lines]
    places: dict[tuple[str, ...], list[int]] = defaultdict(list)
    for at in range(len(lines) - SAME_LINES + 1):
        window = texts[at : at + SAME_LINES]
        if "" not in window and len(set(window)) >= SAME_LINES - 1:
            places[numbered(window)].append(at)
    pairs = {(at[0], other) for at in places.values() for other in at[1:] if other - at[0] >= SAME_LINES}
    found: dict[str, str | int] = {}
    for first, second in sorted(pairs):
        if (first - 1, second - 1) in pairs:
            continue
        length = 0
        while (first + length, second + length) in pairs:
            length += 1
        names = " = ".join(sorted({lines[first][0], lines[second][0]}))
        found[f"{names}: {texts[first][:60]}"] = SAME_LINES + length - 1
    return found


_VARIABLE = re.compile(r"""(?<![\w.'"])[a-z_]\w*(?!\s*\()""")
_MEANT = frozenset({*keyword.kwlist, *dir(builtins), "self", "np"})


def numbered(window: Sequence[str]) -> tuple[str, ...]:
    """Return lines of code with the variables in them numbered in the order in which they come."""
    numbers: dict[str, str] = {}

    def number(found: re.Match[str]) -> str:
        name = found.group()
        return name if name in _MEANT else numbers.setdefault(name, f"v{len(numbers)}")

    return tuple(_VARIABLE.sub(number, line) for line in window)


def _code(module: Module) -> list[str]:
    """Return the module's statements, one a line as Python would print them; an empty line ends each at the top."""
    tree = ast.parse(module.text)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(node, ast.stmt | ast.ExceptHandler) and body:
            node.body = [part for part in body if not _is_apart(part)] or [ast.Pass()]
    found: list[str] = []
    for part in tree.body:
        if not _is_apart(part):
            found += [line.strip() for line in ast.unparse(part).splitlines() if line.strip()] + [""]
    return found


def _is_apart(part: ast.AST) -> bool:
    """Whether a statement is an import, a text or a declaration of a field, with a first value or without."""
    if isinstance(part, ast.Import | ast.ImportFrom):
        return True
    if isinstance(part, ast.AnnAssign) and (part.value is None or _is_number(part.value)):
        return True
    return (
        isinstance(part, ast.Expr)
        and isinstance(part.value, ast.Constant)
        and isinstance(part.value.value, str)
    )


def _is_number(value: ast.expr) -> bool:
    """Whether an expression is a number, or one with its sign."""
    return isinstance(value.operand if isinstance(value, ast.UnaryOp) else value, ast.Constant)


CHECKS: Mapping[str, Callable[[], Findings]] = {
    "circles": circles,
    "constants": constants,
    "duplicates": duplicates,
    "kernels without units": kernels_without_units,
    "long functions": long_functions,
    "long modules": long_modules,
    "wide kernels": wide_kernels,
    "retired names": retired_names,
    "without docstring": without_docstring,
}
"""What is looked for, by name."""
