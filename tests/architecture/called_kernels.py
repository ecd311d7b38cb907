"""Which kernels Python calls, as the sources say: by name, or handed to `kernels.calls.bound`."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

from dubins_traffic.kernels.compile import Kernel
from dubins_traffic.kernels.sources import PACKAGE


def called_kernels() -> dict[str, Path]:
    """Return the names of kernels that functions which are no kernels call, each with a file in which one does."""
    found: dict[str, Path] = {}
    for file in PACKAGE.rglob("*.py"):
        text = file.read_text(encoding="utf-8")
        if "import" not in text or file.parent.name == "kernels":
            continue
        tree = ast.parse(text)
        imported = {
            part.asname or part.name: (line.module, part.name)
            for line in ast.walk(tree)
            if isinstance(line, ast.ImportFrom) and (line.module or "").startswith("dubins_traffic.")
            for part in line.names
        }
        here = ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
        for name in _Used().of(tree):
            module, original = imported.get(name, (here, name))
            kernel = _kernel(str(module), original)
            if kernel is not None:
                found[f"{kernel.__module__}.{kernel.__qualname__}"] = file
    return found


def _kernel(module: str, name: str) -> Any:
    """Return the kernel of a name; None if it is none. Only modules that make kernels are imported."""
    file = PACKAGE.parent.joinpath(*module.split(".")).with_suffix(".py")
    if not file.is_file() or "@jit" not in file.read_text(encoding="utf-8"):
        return None
    found = getattr(import_module(module), name, None)
    return found if isinstance(found, Kernel) else None


class _Used(ast.NodeVisitor):
    """Lists the names that are called, or handed over, outside kernels."""

    def of(self, tree: ast.AST) -> set[str]:
        """Return the names in a module."""
        self._names: set[str] = set()
        self.visit(tree)
        return self._names

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        if not any("jit" in ast.unparse(own) for own in node.decorator_list):
            self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        parts = [node.func, *node.args, *(word.value for word in node.keywords)]
        self._names |= {part.id for part in parts if isinstance(part, ast.Name)}
        self.generic_visit(node)
