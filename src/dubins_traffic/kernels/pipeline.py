"""The steps by which Numba compiles a kernel: those of its usual ones that can find anything to do in a kernel.

Numba's own way has 27 steps, after many of which it works out anew which variable is alive where, in order to say where
each ends: there it counts references and clears memory, of which kernels need neither. Nor have kernels closures,
comprehensions, `with`, `raise`, literal arguments or expressions on whole arrays, for which most other steps are; a
function with code inside goes Numba's own way.
"""

from __future__ import annotations

from types import CodeType
from typing import Any, cast

from numba.core import (
    compiler,  # pyright: ignore[reportMissingTypeStubs]
    ir_utils,  # pyright: ignore[reportMissingTypeStubs]
    rewrites,  # pyright: ignore[reportMissingTypeStubs]
    ssa,  # pyright: ignore[reportMissingTypeStubs]
    targetconfig,  # pyright: ignore[reportMissingTypeStubs]
    transforms,  # pyright: ignore[reportMissingTypeStubs]
    typed_passes,  # pyright: ignore[reportMissingTypeStubs]
    untyped_passes,  # pyright: ignore[reportMissingTypeStubs]
)

_untyped, _typed, _utils = cast(Any, untyped_passes), cast(Any, typed_passes), cast(Any, ir_utils)
_transforms = cast(Any, transforms)
_rewrites, _ssa, _settings = cast(Any, rewrites), cast(Any, ssa), cast(Any, targetconfig)
_usual = cast(Any, compiler).Compiler


class Pipeline(_usual):
    """Compiles one function for arguments of some types."""

    def _compile_core(self) -> Any:
        state = self.state
        if any(isinstance(constant, CodeType) for constant in state.func_id.code.co_consts):
            return _usual._compile_core(self)
        state.type_annotation = None
        with _settings.ConfigStack().enter(state.flags.copy()):
            for step in STEPS:
                step(state)
        state.pipeline = None
        return state.cr


def _order(state: Any) -> None:
    """Join blocks of which one follows another, and leave out those that are never reached."""
    state.func_ir.blocks = _transforms.canonicalize_cfg(state.func_ir.blocks)


def _prune(state: Any) -> None:
    """Leave out branches that arguments which are None decide."""
    _untyped.dead_branch_prune(state.func_ir, state.args)


def _rewrite(state: Any) -> None:
    """Put in what is known before types are: codes (`kernels.codes`), constant indices."""
    blocks = state.func_ir.blocks
    for kind in _rewrites.rewrite_registry.rewrites["before-inference"]:
        rewrite = kind(state)
        waiting = list(blocks.items())
        while waiting:
            label, block = waiting.pop()
            if rewrite.match(state.func_ir, block, state.typemap, state.calltypes):
                blocks[label] = rewrite.apply()
                waiting.append((label, blocks[label]))


def _assign_once(state: Any) -> None:
    """Give each variable one assignment."""
    state.func_ir = _ssa.reconstruct_ssa(state.func_ir)
    state.func_ir._definitions = _utils.build_definitions(state.func_ir.blocks)


def _join(state: Any) -> None:
    """Put assignments in place of what joins variables of several blocks."""
    state.func_ir = _typed.PreLowerStripPhis()._strip_phi_nodes(state.func_ir)
    state.func_ir._definitions = _utils.build_definitions(state.func_ir.blocks)


STEPS = (
    _untyped.TranslateByteCode().run_pass,
    _untyped.FixupArgs().run_pass,
    _order,
    _untyped.RewriteSemanticConstants().run_pass,
    _prune,
    _rewrite,
    _assign_once,
    _typed.NopythonTypeInference().run_pass,
    _join,
    _typed.NativeLowering().run_pass,
    _typed.NoPythonBackend().run_pass,
)
