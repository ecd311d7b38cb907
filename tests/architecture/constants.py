"""Which integer constants kernels read: module-level names of whole numbers, and groups of codes, each counted once.

A kernel that reads a code says which vocabulary it is of: ``RULE.STOP``, a field of one named tuple, so that a
vocabulary counts as one however many codes it has.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from numbers import Integral
from typing import Any

from tests.architecture.house import Findings, Module, modules
from tests.architecture.kernels import JIT, kernels


def constants() -> Findings:
    """Return the integer constants that kernels read, by where they are defined, each with one kernel that does."""
    return {name: kernel.name for module, kernel in compiled() for name in read_by(module, kernel)}


def compiled() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Yield all functions that are compiled, each with the module that it stands in."""
    for module in modules():
        for kernel in kernels(module):
            yield module.name, kernel
        for part in module.tree.body:
            match part:
                case ast.Assign(value=ast.Call(func=ast.Name(id=name), args=[ast.Name(id=own)])) if name in JIT:
                    yield _function(*defined(module.name, own))
                case _:
                    pass


def read_by(module: str, kernel: ast.FunctionDef) -> frozenset[str]:
    """Return the constants that a kernel reads, by where they are defined."""
    own = {node.id for node in ast.walk(kernel) if isinstance(node, ast.Name)}
    values = vars(import_module(f"dubins_traffic.{module}"))
    read = own - {one.arg for one in kernel.args.args}
    return frozenset(".".join(defined(module, name)) for name in read if is_constant(values.get(name)))


def is_constant(value: Any) -> bool:
    """Whether a global is a whole number, or a group of such."""
    if isinstance(value, tuple):
        return len(value) > 0 and all(is_constant(one) for one in value)
    return isinstance(value, Integral)


def defined(module: str, name: str) -> tuple[str, str]:
    """Return the module that defines what a module calls `name`, and what it is called there."""
    for part in _named(module).tree.body:
        if isinstance(part, ast.ImportFrom) and (part.module or "").startswith("dubins_traffic."):
            for own in part.names:
                if (own.asname or own.name) == name:
                    return defined(str(part.module).removeprefix("dubins_traffic."), own.name)
    return module, name


def _function(module: str, name: str) -> tuple[str, ast.FunctionDef]:
    (found,) = (part for part in _named(module).tree.body if isinstance(part, ast.FunctionDef) and part.name == name)
    return module, found


def _named(name: str) -> Module:
    (found,) = (module for module in modules() if module.name == name)
    return found
