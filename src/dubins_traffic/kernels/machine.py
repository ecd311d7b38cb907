"""Machine code: kernels are called, and those that no library holds are loaded into this process by llvmlite."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterator, Sequence
from functools import cache
from importlib import import_module
from threading import Lock
from typing import Any, cast

from dubins_traffic.kernels import levels
from dubins_traffic.kernels.kinds import NONE, Kind, is_number, is_place, letters, packed, place_of


class Loader:
    """What loads machine code into this process; kept for ever, like all that it has loaded."""

    def __init__(self) -> None:
        from llvmlite import binding  # pyright: ignore[reportMissingTypeStubs]

        self._llvm = cast(Any, binding)
        self._llvm.initialize_native_target()
        self._llvm.initialize_native_asmprinter()
        target = self._llvm.Target.from_triple(self._llvm.get_process_triple())
        machine = target.create_target_machine(jit=True)
        self._engine = self._llvm.create_mcjit_compiler(self._llvm.parse_assembly(""), machine)

    def load(self, code: bytes, symbol: str) -> int:
        """Return the address of the function `symbol` of an object file, which takes a frame and room for an answer."""
        self._engine.add_object_file(self._llvm.ObjectFileRef.from_data(code))
        self._engine.finalize_object()
        return self._engine.get_function_address(symbol)


_lock = Lock()


@cache
def _loader() -> Loader:
    return Loader()


def load(code: bytes, symbol: str) -> int:
    """Load an object file into this process and return the address of its function `symbol`."""
    with _lock:
        return _loader().load(code, symbol)


@cache
def processor() -> tuple[str, ...]:
    """Return for which processor machine code is loaded: the best level that runs here, or `this_processor`.

    Raises
    ------
    InputError
        If the environment names no level.
    """
    return levels.levels()[:1] or this_processor()


@cache
def target() -> tuple[str, ...]:
    """Return for which processor is compiled: that of `processor`, unless the environment names another level.

    Raises
    ------
    InputError
        If the environment names no level.
    """
    level = levels.level()
    return (level,) if level else this_processor()


def this_processor() -> tuple[str, ...]:
    """Return the name of this processor and what it can do, where there are no levels."""
    from llvmlite import binding  # pyright: ignore[reportMissingTypeStubs]

    llvm = cast(Any, binding)
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()


class Code:
    """Machine code of a kernel for arguments of some kinds.

    Parameters
    ----------
    kinds : sequence of Kind
        Those of its arguments.
    answer : Kind
        That of what it returns.
    where : int
        The address that `load` returns.

    Attributes
    ----------
    kinds, answer, address
        The same.
    """

    def __init__(self, kinds: Sequence[Kind], answer: Kind, where: int) -> None:
        self.kinds = tuple(kinds)
        self._pack = struct.Struct(
            "@" + "".join("q" if not is_number(kind) else letters(kind) for kind in kinds)
        ).pack
        self.address = where
        self.answer = answer
        self._function = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_char_p, ctypes.c_void_p)(where)
        self._read = struct.Struct("@" + letters(answer))

    def call(self, whole: Sequence[Any]) -> Any:
        """Call it with all arguments."""
        kept: list[Any] = []
        values: list[Any] = []
        for value, kind in zip(whole, self.kinds, strict=True):
            values.append(value if is_number(kind) else address(value, kind, kept))
        out = self.room()
        if self._function(self._pack(*values), out):
            raise RuntimeError("a kernel has failed")
        return self.read(out)

    def room(self) -> ctypes.Array[ctypes.c_char] | None:
        """Return room for an answer, None where there is none."""
        return ctypes.create_string_buffer(self._read.size) if self._read.size else None

    def read(self, room: ctypes.Array[ctypes.c_char] | None) -> Any:
        """Return the answer in its room."""
        if room is None:
            return _built(self.answer, iter(()))
        values = self._read.unpack(room)
        return values[0] if is_number(self.answer) else _built(self.answer, iter(values))


def address(value: object, kind: Kind, kept: list[Any]) -> int:
    """Return the address of a new block for an array or tuple; the block is appended to what is to be kept."""
    if kind == NONE:
        return 0
    if is_place(kind):
        kept.append(value)
        return place_of(value)
    block = packed(value, kind)
    kept.append((value, block))
    return ctypes.addressof(block)


def _built(kind: Kind, values: Iterator[Any]) -> Any:
    if is_number(kind):
        return next(values)
    if kind == NONE:
        return None
    parts = [_built(part, values) for part in kind[-1]]
    return tuple(parts) if kind[0] == "tuple" else getattr(import_module(kind[1]), kind[2])(*parts)
