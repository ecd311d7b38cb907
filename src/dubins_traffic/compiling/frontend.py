"""Numba's front end without what it does again and again: the same machine code, in less time.

Each function here changes one inner part of Numba, in the builder's process alone. What they leave out is looking up
what has been found before, and telling of events to which nobody listens.

`Pipeline` has the steps by which a kernel is compiled: those of Numba's usual ones that can find anything to do in a
kernel. Numba's own way has 27 steps, after many of which it works out anew which variable is alive where, in order to
say where each ends: there it counts references and clears memory, of which kernels need neither. Nor have kernels
closures, comprehensions, `with`, `raise`, literal arguments or expressions on whole arrays, for which most other steps
are; a function with code inside goes Numba's own way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import CodeType
from typing import Any, cast

import llvmlite.binding.ffi  # pyright: ignore[reportMissingTypeStubs]
from numba.core import (
    base,  # pyright: ignore[reportMissingTypeStubs]
    compiler,  # pyright: ignore[reportMissingTypeStubs]
    event,  # pyright: ignore[reportMissingTypeStubs]
    interpreter,  # pyright: ignore[reportMissingTypeStubs]
    ir,  # pyright: ignore[reportMissingTypeStubs]
    ir_utils,  # pyright: ignore[reportMissingTypeStubs]
    lowering,  # pyright: ignore[reportMissingTypeStubs]
    rewrites,  # pyright: ignore[reportMissingTypeStubs]
    ssa,  # pyright: ignore[reportMissingTypeStubs]
    targetconfig,  # pyright: ignore[reportMissingTypeStubs]
    transforms,  # pyright: ignore[reportMissingTypeStubs]
    typed_passes,  # pyright: ignore[reportMissingTypeStubs]
    typeinfer,  # pyright: ignore[reportMissingTypeStubs]
    untyped_passes,  # pyright: ignore[reportMissingTypeStubs]
)
from numba.core.types import functions  # pyright: ignore[reportMissingTypeStubs]
from numba.core.typing import context  # pyright: ignore[reportMissingTypeStubs]

_ffi, _base, _event, _ir = cast(Any, llvmlite.binding.ffi), cast(Any, base), cast(Any, event), cast(Any, ir)
_lowering, _infer, _ssa = cast(Any, lowering), cast(Any, typeinfer), cast(Any, ssa)
_interpreter = cast(Any, interpreter)
_settings, _functions, _typing = cast(Any, targetconfig), cast(Any, functions), cast(Any, context)
_untyped, _typed, _utils = cast(Any, untyped_passes), cast(Any, typed_passes), cast(Any, ir_utils)
_transforms, _rewrites = cast(Any, transforms), cast(Any, rewrites)
_usual = cast(Any, compiler).Compiler

IMPLEMENTED = "functions", "getattrs", "setattrs", "casts", "constants"
TYPED = "functions", "attributes", "globals"
"""What Numba's registries list."""


def shorten() -> None:
    """Leave out from now on what Numba does again and again."""
    _tell_nobody()
    _compare_quickly()
    _remember_calls()
    _remember_sizes()
    _remember_signatures()
    _refresh_seldom()
    _list_variables_quickly()
    _leave_whole()


class _Nothing:
    """A context that does nothing, a log that nobody reads."""

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None: ...

    def debug(self, *_: object) -> None:
        """Write nothing."""


def _tell_nobody() -> None:
    """Say nothing about passes, locks and places in the source; the builder has one thread that compiles."""
    nothing = _Nothing()
    _event.start_event = _event.end_event = lambda *_, **__: None  # pyright: ignore[reportUnknownLambdaType]
    _ffi._lib_fn_wrapper.__call__ = _call
    for module in (_lowering, _infer):
        module.new_error_context = lambda *_, **__: nothing  # pyright: ignore[reportUnknownLambdaType]
    _ssa._logger = nothing
    _ir.Assign.__str__ = _no_text  # every statement is written out for a message that nobody asks for


def _no_text(_statement: object) -> str:
    """Return no text."""
    return ""


def _call(dispatcher: Any, *args: Any) -> Any:
    """Call a function of LLVM without a lock."""
    return dispatcher._cfn(*args)


def _compare_quickly() -> None:
    """Let Numba compare its settings, which are part of many keys, by what has been set."""
    settings = _settings.TargetConfig
    thorough = settings.__eq__

    def is_equal(one: Any, other: Any) -> Any:
        return (type(one) is type(other) and one._values == other._values) or thorough(one, other)

    settings.__eq__ = is_equal
    settings.__hash__ = _same


def _same(_settings: object) -> int:
    """Return a hash of settings, of which few differ."""
    return 1


def _remember_calls() -> None:
    """Find the signature of a call of what Numba offers (operators, `min`, ...) once for types of arguments."""
    callee = _functions.BaseFunction
    find = callee.get_call_type

    def found(own: Any, types: Any, args: Any, named: Any) -> Any:
        known: dict[Any, Any] = own.__dict__.setdefault("_found", {})
        flags = _settings.ConfigStack.top_or_none()
        key = tuple(args), tuple(named.items()), flags is not None and flags.forceinline
        if key not in known:
            signature = find(own, types, args, named)
            known[key] = signature, own._impl_keys[signature.args]
        signature, own._impl_keys[signature.args] = known[key]
        return signature

    callee.get_call_type = found


def _remember_sizes() -> None:
    """Find the size of a type once: Numba makes a program for it each time."""
    _base.BaseContext.get_abi_sizeof = _kept(_base.BaseContext.get_abi_sizeof)


def _kept(find: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    known: dict[Any, Any] = {}

    def found(own: Any, key: Any) -> Any:
        if key not in known:
            known[key] = find(own, key)
        return known[key]

    return found


def _remember_signatures() -> None:
    """Look once whether what writes an operation takes its place in the source."""
    _base._has_loc = cache(_base._has_loc)


def _refresh_seldom() -> None:
    """Take up what has been registered only if something has been."""
    whole, typing = _base.BaseContext.refresh, _typing.BaseContext.refresh
    seen: dict[int, int] = {}

    def refresh(context: Any) -> None:
        now = _count(context, IMPLEMENTED) + _count(context.typing_context, TYPED)
        if now == 0 or seen.get(id(context._registries)) != now:
            whole(context)
            seen[id(context._registries)] = _count(context, IMPLEMENTED) + _count(context.typing_context, TYPED)

    def refresh_types(context: Any) -> None:
        now = _count(context, TYPED)
        if now == 0 or seen.get(id(context._registries)) != now:
            typing(context)
            seen[id(context._registries)] = _count(context, TYPED)

    _base.BaseContext.refresh, _typing.BaseContext.refresh = refresh, refresh_types


def _count(context: Any, lists: tuple[str, ...]) -> int:
    return sum(len(getattr(registry, name)) for registry in context._registries for name in lists)


def _list_variables_quickly() -> None:
    """List the variables of a statement without a list for each part of it."""
    _ir.Stmt.list_vars, _ir.Expr.list_vars = _of_statement, _of_expression


def _of_statement(statement: Any) -> list[Any]:
    parts: list[Any] = []
    for value in statement.__dict__.values():
        _gather(value, parts)
    return parts


def _of_expression(expression: Any) -> list[Any]:
    parts: list[Any] = []
    for value in expression._kws.values():
        _gather(value, parts)
    return parts


def _gather(value: Any, parts: list[Any]) -> None:
    kind: Any = value.__class__
    if kind is _VARIABLE:
        parts.append(value)
    elif kind in _WITHOUT:
        pass
    elif kind is tuple or kind is list:
        for part in value:
            _gather(part, parts)
    elif kind is dict:
        for part in value.values():
            _gather(part, parts)
    elif isinstance(value, _ir.Inst):
        parts.extend(value.list_vars())


_VARIABLE: Any = _ir.Var
_WITHOUT = frozenset((_ir.Loc, str, int, type(None), _ir.Scope))
"""Kinds of parts in which there are no variables."""


def _leave_whole() -> None:
    """Look for no `with` and no dictionaries in what is read of a function: kernels have none."""
    for name in ("peep_hole_delete_with_exit", "peep_hole_fuse_dict_add_updates"):
        setattr(_interpreter, name, _same_function)


def _same_function(function: Any) -> Any:
    return function


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
    """Put in what is known before types are: codes (`compiling.lowering`), constant indices."""
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
