"""Loading: machine code that no library holds comes into this process by llvmlite, for the processor that it is for."""

from __future__ import annotations

from functools import cache
from threading import Lock
from typing import Any, cast

from dubins_traffic.kernels import levels


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
