"""How Numba compiles a code of a group: a field of a named tuple that is global, as if the number stood there.

Numba would take a constant tuple apart, which the optimizer undoes, but not without other choices on the way: what is
put into what. So a group of codes costs nothing, and machine code is to the byte what it is of bare names.
"""

from __future__ import annotations

from typing import Any, cast

from numba.core import ir as _ir  # pyright: ignore[reportMissingTypeStubs]
from numba.core import rewrites as _rewrites  # pyright: ignore[reportMissingTypeStubs]

ir, rewrites = cast(Any, _ir), cast(Any, _rewrites)


class Codes(rewrites.Rewrite):
    """Puts numbers in place of fields of groups, block for block, before types are inferred."""

    def match(self, func_ir: Any, block: Any, typemap: Any, calltypes: Any) -> bool:  # noqa: ARG002  # as Numba calls it
        """Look for codes in a block; return whether there are any."""
        self._block, self._found = block, dict[Any, Any]()
        groups: dict[str, Any] = {}
        for line in block.find_insts(ir.Assign):
            value = line.value
            if isinstance(value, ir.Global) and hasattr(value.value, "_fields"):
                groups[line.target.name] = value.value
            elif isinstance(value, ir.Expr) and value.op == "getattr" and value.value.name in groups:
                code = ir.Global(value.attr, getattr(groups[value.value.name], value.attr), line.loc)
                self._found[line] = ir.Assign(code, line.target, line.loc)
        return bool(self._found)

    def apply(self) -> Any:
        """Return the block with the numbers in it."""
        made = self._block.copy()
        made.body = [self._found.get(line, line) for line in self._block.body]
        return made


def take_as_numbers() -> None:
    """Let Numba compile codes so from now on."""
    rewrites.register_rewrite("before-inference")(Codes)
