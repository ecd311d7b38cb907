"""Which public kernels do not say what their parameters are: shapes of arrays, units of numbers.

A parameter is said to be something where

- its type is a table or a row, a class of the package that says what its fields are, or is a tuple of such;
- `dubins_traffic.kernels` lists its name and type among those that mean the same in every kernel, or the package that
  holds the kernel does among those that mean the same in all of its own; or
- the kernel's docstring names it in backticks, with a shape, a unit or a range in parentheses behind it, as in
  ``"`margin` (m)"``, or its section *Parameters* has an entry for it that gives one.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache

from tests.architecture.house import Findings, Module, modules

JIT = frozenset({"jit", "jit_inline", "jit_long", "jit_look", "jit_rare", "jit_wide"})
"""What makes a function a kernel."""
WIDE = 8
"""So many parameters of a kernel are too many: tables, rows and nouns (a pose, a body) hold what belongs together."""
_ROW = re.compile(r"^(\w+(?:, \w+)*) +(\w+) {2,}\S", re.MULTILINE)
_OF_ROWS = re.compile(r"^(?:Rows|Grid)\[(\w+)\]$")
_ENTRY = re.compile(r"^(\w+(?:, \w+)*)(?: : (.*))?\n((?:    .*\n?)+)", re.MULTILINE)
_SHAPE = re.compile(r"\((?:[A-Z]\w*(?: \+ \d+)?|\d+),[^)]*\)|\bmetres\b")
_UNIT = re.compile(
    r"\((?:[A-Z]\w*(?: [+*] \w+)?,|\d+,)|\b(?i:m|metres?|seconds?|s|rad|radians|m/s|rad/s|1/m|1/s|Hz|ticks?|frames?|"
    r"bytes?|indices|index|numbers?|first|count|share|unit vectors?|vertex|lane|segment|intersection|car|trial|"
    r"whether|bits|flags?|row|position|goal|node|scene|debt|term|in \[0, 1\])\b"
)


def kernels_without_units() -> Findings:
    """Public kernels whose docstring leaves open what some parameters are, with the names of these."""
    found: dict[str, str | int] = {}
    for module in modules():
        for kernel in public_kernels(module):
            missing = [one.arg for one in kernel.args.args if not is_said(kernel, one, module.name)]
            if missing:
                found[f"{module.name}.{kernel.name}"] = ", ".join(missing)
    return found


def wide_kernels() -> Findings:
    """Kernels with too many parameters, each with their number."""
    found: dict[str, str | int] = {}
    for module in modules():
        for kernel in kernels(module):
            if len(kernel.args.args) >= WIDE:
                found[f"{module.name}.{kernel.name}"] = len(kernel.args.args)
    return found


def public_kernels(module: Module) -> Iterator[ast.FunctionDef]:
    """Yield the compiled functions of a module whose names do not begin with an underscore."""
    return (kernel for kernel in kernels(module) if not kernel.name.startswith("_"))


def kernels(module: Module) -> Iterator[ast.FunctionDef]:
    """Yield the compiled functions of a module."""
    for item in module.tree.body:
        if isinstance(item, ast.FunctionDef):
            decorators = {ast.unparse(one).split("(")[0].split(".")[-1] for one in item.decorator_list}
            if decorators & JIT:
                yield item


def is_said(kernel: ast.FunctionDef, one: ast.arg, name: str = "") -> bool:
    """Whether it is said what a parameter of a kernel of the module `name` is."""
    kind = "" if one.annotation is None else ast.unparse(one.annotation)
    common = common_parameters("kernels") | common_parameters(name.rpartition(".")[0])
    if (one.arg, kind) in common or kind.split("[")[0] in table_types():
        return True
    text = ast.get_docstring(kernel) or ""
    if re.search(rf"`{one.arg}` \([^)]*\w[^)]*\)", text):
        return True
    parameters = text.partition("Parameters\n----------\n")[2]
    for names, header, body in _ENTRY.findall(parameters + "\n"):
        if one.arg in names.split(", "):
            return _UNIT.search(f"{header} {body}") is not None
    return False


@cache
def common_parameters(room: str) -> frozenset[tuple[str, str]]:
    """Return names and types of the parameters that a package's docstring says mean the same in every kernel."""
    texts = [ast.get_docstring(module.tree) or "" for module in modules() if module.name == room]
    rows = _ROW.findall("\n".join(texts))
    return frozenset((name, kind) for names, kind in rows for name in names.split(", "))


@cache
def table_types() -> frozenset[str]:
    """Return the names of the package's classes that say what their fields are: tables, and rows of tables."""
    classes = [item for module in modules() for item in module.definitions() if isinstance(item, ast.ClassDef)]
    found = {"Rows"} | {item.name for item in classes if _says_its_fields(item)}
    return frozenset(found | {item.name for item in classes if _fields(item) and _fields(item) <= found})


def _fields(item: ast.ClassDef) -> set[str]:
    """Return the types of a class's fields; of rows of a table that of a row."""
    kinds = {ast.unparse(part.annotation) for part in item.body if isinstance(part, ast.AnnAssign)}
    return {_OF_ROWS.sub(r"\1", kind) for kind in kinds}


def _says_its_fields(item: ast.ClassDef) -> bool:
    """Whether a class has a section *Attributes*, gives shapes or units in its docstring, or a text for each field."""
    text = ast.get_docstring(item) or ""
    if "Attributes\n----------" in text or _SHAPE.search(text):
        return True
    body = item.body
    fields = [k for k, part in enumerate(body) if isinstance(part, ast.AnnAssign)]
    return bool(fields) and all(
        k + 1 < len(body) and isinstance(body[k + 1], ast.Expr) and isinstance(body[k + 1].value, ast.Constant)
        for k in fields
    )
