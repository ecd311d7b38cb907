"""Machine code in this process, and how a kernel is called by its address."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterator, Sequence
from importlib import import_module
from typing import Any

from dubins_traffic.kernels.kinds import NONE, Kind, is_number, is_place, letters, packed, place_of


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
        self._pack = struct.Struct("@" + "".join("q" if not is_number(kind) else letters(kind) for kind in kinds)).pack
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
