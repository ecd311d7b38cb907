"""The compiler: from a kernel and the kinds of its arguments to machine code. Only the builder imports it.

Numba compiles each function to a library of its own, links into it all that it calls, optimises that, makes machine
code of it, and then the same again for every function that calls it. Here functions are left as they are, until an
entry, which Python calls, takes up all that it calls, once: they are put together as one program, of which only the
entry can be called from outside. What only it calls is put into it, and the others are handed only what they use.

Nor is there code that unpacks Python's arguments one by one: an entry reads numbers and addresses from a frame
(`kernels.kinds`).

Numba's front end, typing and writing LLVM's language, takes most of the time: `compiling.frontend` has fewer steps,
`compiling.frontend` finds things once, `compiling.lowering` writes less.

This rests on inner parts of Numba (`docs/design/030-speed.md`); it is the builder's process alone that they are
changed in.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

import llvmlite.binding  # pyright: ignore[reportMissingTypeStubs]
import llvmlite.ir  # pyright: ignore[reportMissingTypeStubs]
import numba
from numba.core import codegen, config, types  # pyright: ignore[reportMissingTypeStubs]
from numba.core.registry import cpu_target  # pyright: ignore[reportMissingTypeStubs]
from numba.np import arrayobj, numpy_support  # pyright: ignore[reportMissingTypeStubs]

from dubins_traffic.compiling.frontend import Pipeline, shorten
from dubins_traffic.compiling.lowering import TablesType, index_plainly, learn_fetches, take_as_numbers
from dubins_traffic.kernels.kinds import NONE, Kind, UnfitError, dtype_of, is_place

RESHAPE = "numba_attempt_nocopy_reshape"
"""What Numba calls to reshape an array."""
FOREIGN = ("numba", "NRT", "Py", "_Py")
"""How the names of functions begin that only a process with Numba or for Python has."""
SELDOM = 2_000_000
"""New objects between two searches for rubbish: there is little among what the compiler makes, 0.1 million a second."""

_numba = cast(Any, numba)
_types = cast(Any, types)
_ir = cast(Any, llvmlite.ir)
_llvm = cast(Any, llvmlite.binding)
_config = cast(Any, config)
_arrays = cast(Any, arrayobj)
_dtypes = cast(Any, numpy_support)
_usual = cast(Any, codegen).JITCodeLibrary


class Library(_usual):
    """A compiled function as it is, without what it calls, until an entry takes it up."""

    def finalize(self) -> None:
        """Leave everything as it is."""
        self._finalized = True

    def _optimize_functions(self, module: Any) -> None:
        """Optimize each function that a module holds, and none that it only calls."""
        module.data_layout = self._codegen._data_layout
        for function in module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

    def get_pointer_to_function(self, name: str) -> int:  # noqa: ARG002  # as Numba calls it
        """Return that there is none yet."""
        return 0


class Compiler:
    """Makes machine code of kernels, one entry at a time; what they call is looked at once for all of them."""

    def __init__(self) -> None:
        self._context = cast(Any, cpu_target).target_context
        self._context.refresh()
        self._codegen = self._context.codegen()
        self._codegen._library_class = Library
        self._codegen.set_env = _leave
        self._machine = _position_independent(self._codegen)
        self._rare: list[Any] = []
        index_plainly()
        shorten()
        take_as_numbers()
        learn_fetches()
        gc.set_threshold(SELDOM)

    def jit(self, function: Callable[..., Any], *, inlined: bool, wide: bool, rare: bool) -> Any:
        """Return what Numba makes of a kernel's function, for others to call and for `machine_code`."""
        made = _numba.njit(
            error_model="numpy", nogil=True, forceinline=inlined, _nrt=False, no_cfunc_wrapper=True,
            no_cpython_wrapper=True, pipeline_class=Pipeline,
        )(function)  # fmt: skip
        made.is_wide = wide
        if rare:
            self._rare.append(made)
        return made

    def kernel(self, module: Any, name: str) -> Any:
        """Return what `jit` has made of a function, wherever that was, if it was."""
        kernel = getattr(module, name)
        return kernel if hasattr(kernel, "py_func") else self.jit(kernel, inlined=False, wide=False, rare=False)

    def machine_code(self, kernel: Any, kinds: Sequence[Kind], symbol: str) -> tuple[bytes, Kind]:
        """Return an object file with the function `symbol`, and the kind of what the kernel returns.

        The function takes the addresses of a frame and of a block for what is returned, and returns 0 if all went
        well.

        Raises
        ------
        UnfitError
            If it returns what can't be handed over.
        """
        types = tuple(_type_of(kind) for kind in kinds)
        kernel.compile(types)
        compiled = kernel.overloads[types]
        returned = _kind_of(compiled.fndesc.restype)
        module = self._entry(compiled.fndesc, kinds, symbol)
        _add_reshape(module)
        program = _llvm.parse_assembly(str(module))
        for library in _reached(compiled.library):
            program.link_in(library._final_module, preserve=True)
        _close(program, symbol)
        self._set_apart(program)
        whole = Library(self._codegen, symbol)
        whole._final_module = program
        usual, _config.SLP_VECTORIZE = _config.SLP_VECTORIZE, int(kernel.is_wide or _config.SLP_VECTORIZE)
        try:
            _usual._optimize_final_module(whole)
        finally:
            _config.SLP_VECTORIZE = usual
        _check(program)
        return self._machine.emit_object(program), returned

    def _set_apart(self, program: Any) -> None:
        """Say of the functions of a program that are rarely called that they are: they are put into no other one."""
        rare = {overload.fndesc.llvm_func_name for made in self._rare for overload in made.overloads.values()}
        for function in program.functions:
            if function.name in rare:
                function.add_function_attribute("cold")

    def _entry(self, described: Any, kinds: Sequence[Kind], symbol: str) -> Any:
        """Return a module with the function that reads the frame, calls the kernel and writes what it returns."""
        context = self._context
        module = context.create_module(symbol)
        byte = _ir.IntType(8).as_pointer()
        entry = _ir.Function(module, _ir.FunctionType(_ir.IntType(32), [byte, byte]), symbol)
        for argument in entry.args:
            argument.add_attribute("noalias")
        kernel = context.call_conv.get_function_type(described.restype, described.argtypes)
        callee = _ir.Function(module, kernel, described.llvm_func_name)
        builder = _ir.IRBuilder(entry.append_basic_block("entry"))
        frame = _Reader(context, builder, entry.args[0])
        arguments = [frame.argument(kind, argtype) for kind, argtype in zip(kinds, described.argtypes, strict=True)]
        status, value = context.call_conv.call_function(
            builder, callee, described.restype, described.argtypes, arguments
        )
        with builder.if_then(status.is_error):
            builder.ret(_ir.IntType(32)(1))
        word = _ir.IntType(64)
        target = builder.bitcast(entry.args[1], word.as_pointer())
        for k, leaf in enumerate(_leaves(context, builder, described.restype, value)):
            builder.store(leaf, builder.gep(target, [word(k)]))
        builder.ret(_ir.IntType(32)(0))
        return module


def _position_independent(usual: Any) -> Any:
    """Return what writes machine code that can stand anywhere, as that of libraries must, else as `usual` does."""
    target = _llvm.Target.from_triple(_llvm.get_process_triple())
    return target.create_target_machine(
        cpu=usual._get_host_cpu_name(), features=usual._get_host_cpu_features(), opt=3, reloc="pic",
        codemodel="default",
    )  # fmt: skip


class _Reader:
    """Reads a frame or a block, eight bytes after eight bytes."""

    def __init__(self, context: Any, builder: Any, base: Any) -> None:
        self._context, self._builder = context, builder
        self._base = builder.bitcast(base, _ir.IntType(64).as_pointer())
        self._next = 0

    def argument(self, kind: Kind, numba_type: Any) -> Any:
        """Return an argument: a number, or what is in its block."""
        if kind[0] == "number" or kind == NONE:
            if kind == NONE:
                self._word()
            return self._value(kind, numba_type)
        if is_place(kind):
            return self._value(kind, numba_type)
        block = self._builder.inttoptr(self._word(), _ir.IntType(8).as_pointer())
        return _Reader(self._context, self._builder, block)._value(kind, numba_type)

    def _word(self) -> Any:
        builder = self._builder
        place = builder.gep(self._base, [_ir.IntType(64)(self._next)])
        self._next += 1
        return builder.load(place)

    def _value(self, kind: Kind, numba_type: Any) -> Any:
        if kind == NONE:
            return self._context.get_dummy_value()
        if kind[0] == "number":
            return self._number(numba_type)
        if kind[0] == "array":
            return self._array(numba_type)
        if is_place(kind):
            return self._builder.inttoptr(self._word(), self._context.get_value_type(numba_type))
        parts = [self._value(part, each) for part, each in zip(kind[-1], numba_type.types, strict=True)]
        return self._context.make_tuple(self._builder, numba_type, parts)

    def _number(self, numba_type: Any) -> Any:
        builder, word = self._builder, self._word()
        kind = self._context.get_value_type(numba_type)
        if isinstance(numba_type, _types.Boolean):
            return builder.trunc(word, kind)
        if isinstance(numba_type, _types.Float):
            real = builder.bitcast(word, _ir.DoubleType())
            return real if numba_type.bitwidth == 64 else builder.fptrunc(real, kind)
        return word if numba_type.bitwidth == 64 else builder.trunc(word, kind)

    def _array(self, numba_type: Any) -> Any:
        array = self._context.make_array(numba_type)(self._context, self._builder)
        data = self._builder.inttoptr(self._word(), array.data.type)
        count, size = self._word(), self._word()
        shape = [self._word() for _ in range(numba_type.ndim)]
        strides = [self._word() for _ in range(numba_type.ndim)]
        _arrays.populate_array(array, data=data, shape=shape, strides=strides, itemsize=size, meminfo=None)
        array.nitems = count
        return array._getvalue()


def _leaves(context: Any, builder: Any, shape: Any, value: Any) -> Iterator[Any]:
    """Yield the numbers of what a kernel returns, each in 64 bits."""
    word = _ir.IntType(64)
    if isinstance(shape, _types.BaseTuple):
        for k, part in enumerate(shape):
            yield from _leaves(context, builder, part, builder.extract_value(value, k))
    elif isinstance(shape, _types.Float):
        yield builder.bitcast(value if shape.bitwidth == 64 else builder.fpext(value, _ir.DoubleType()), word)
    elif isinstance(shape, _types.Integer) and shape.signed:
        yield value if shape.bitwidth == 64 else builder.sext(value, word)
    elif shape is not _types.none:
        yield builder.zext(value, word) if value.type != word else value


def _reached(library: Any) -> list[Any]:
    """Return a library and all that it calls, over any steps, each once."""
    kernels: dict[int, Any] = {}
    waiting = [library]
    while waiting:
        reached = waiting.pop()
        if id(reached) not in kernels:
            kernels[id(reached)] = reached
            waiting.extend(reached._linking_libraries)
    return list(kernels.values())


def _close(program: Any, symbol: str) -> None:
    """Let only the entry be called from outside."""
    for own in program.functions:
        if not own.is_declaration and own.name != symbol:
            own.linkage = "internal"
    for own in program.global_variables:
        if own.name.startswith("numba.dynamic.globals"):
            raise UnfitError("a kernel with addresses of this process")
        if not own.is_declaration:
            own.linkage = "internal"


def _check(program: Any) -> None:
    """Raise UnfitError if a program needs functions of Numba or Python, which are not there where it is loaded."""
    for function in program.functions:
        if function.is_declaration and function.name.startswith(FOREIGN):
            raise UnfitError(f"a kernel that needs {function.name}")


def _add_reshape(module: Any) -> None:
    """Add what Numba calls to reshape an array without a copy, for arrays in C order: all that kernels have."""
    word, number = _ir.IntType(64), _ir.IntType(32)
    words = word.as_pointer()
    kind = _ir.FunctionType(number, [word, words, words, word, words, words, word, number])
    function = _ir.Function(module, kind, RESHAPE)
    _, _, _, count, shape, strides, size, _ = function.args
    begin, each, end = (function.append_basic_block(name) for name in ("begin", "each", "end"))
    builder = _ir.IRBuilder(begin)
    builder.cbranch(builder.icmp_signed(">", count, word(0)), each, end)
    builder.position_at_end(each)
    left, stride = builder.phi(word), builder.phi(word)
    k = builder.sub(left, word(1))
    builder.store(stride, builder.gep(strides, [k]))
    next_stride = builder.mul(stride, builder.load(builder.gep(shape, [k])))
    builder.cbranch(builder.icmp_signed(">", k, word(0)), each, end)
    for phi, first, later in ((left, count, k), (stride, size, next_stride)):
        phi.add_incoming(first, begin)
        phi.add_incoming(later, each)
    builder.position_at_end(end)
    builder.ret(number(1))


def _type_of(kind: Kind) -> Any:
    if kind == NONE:
        return _types.none
    if kind[0] == "number":
        return _dtypes.from_dtype(dtype_of(kind[1]))
    if kind[0] == "array":
        _, elements, ndim, layout, writable = kind
        return _types.Array(_dtypes.from_dtype(dtype_of(elements)), ndim, layout, readonly=not writable)
    if kind[0] == "row":
        return _dtypes.from_dtype(dtype_of(kind[1]))
    if kind[0] == "tables":
        return TablesType(kind[1], tuple((name, _type_of(part)) for name, part in kind[2]))
    parts = [_type_of(part) for part in kind[-1]]
    if kind[0] == "tuple":
        return _types.Tuple(parts)
    return _types.BaseTuple.from_types(parts, named(kind[1], kind[2]))


def named(module: str, name: str) -> Any:
    """Return what a module calls `name`."""
    from importlib import import_module

    thing: Any = import_module(module)
    for part in name.split("."):
        thing = getattr(thing, part)
    return thing


def _kind_of(numba_type: Any) -> Kind:
    """Return the kind of what a kernel returns."""
    if numba_type is _types.none:
        return NONE
    if isinstance(numba_type, _types.BaseNamedTuple):
        cls = numba_type.instance_class
        return "named", cls.__module__, cls.__qualname__, tuple(_kind_of(part) for part in numba_type)
    if isinstance(numba_type, _types.BaseTuple):
        return "tuple", tuple(_kind_of(part) for part in numba_type)
    if isinstance(numba_type, _types.Boolean | _types.Integer | _types.Float):
        return "number", _dtypes.as_dtype(numba_type).str[1:]
    raise UnfitError(f"a kernel that returns {numba_type}")


def _leave(_name: str, _environment: Any) -> None:
    """Leave the environment of a function alone: no kernel needs any."""
