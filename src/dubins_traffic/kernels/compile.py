"""Kernels: functions that run interpreted until their machine code is there, with the same bits.

A function that `jit` has taken is called as machine code if a library holds it (`kernels.library`). If none does, it
runs as it is while a builder compiles it beside, and a later call goes over to machine code.
`DUBINS_TRAFFIC_KERNELS` says ``auto`` for that, ``compiled`` for waiting until machine code is there, ``interpreted``
for never compiling, as ``NUMBA_DISABLE_JIT=1`` does. A kernel looks into what is kept from tick to tick by a
`jit_look`; with `DUBINS_TRAFFIC_CACHES` set to ``off`` nothing is kept.
"""

from __future__ import annotations

import inspect
import multiprocessing
import os
import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from time import monotonic
from types import FunctionType
from typing import Any, Generic, NamedTuple, ParamSpec, Protocol, TypeVar, cast

import numpy as np

from dubins_traffic.above import ABOVE
from dubins_traffic.errors import InputError
from dubins_traffic.kernels import library, sources
from dubins_traffic.kernels.folders import KEPT, TIER
from dubins_traffic.kernels.kinds import Kind, UnfitError, kind_of
from dubins_traffic.kernels.machine import Code

P = ParamSpec("P")
R = TypeVar("R")

CACHES = "DUBINS_TRAFFIC_CACHES"
"""The environment variable that turns off all that kernels keep from tick to tick: for tests, and to find mistakes."""
TIERS = ("auto", "compiled", "interpreted", KEPT)
"""`kept`: what has been compiled is used, of a folder that need not be one's own, and nothing else is compiled."""
PAUSE = 0.25
"""Seconds between two looks for a kernel that is wanted."""


class Waiting(Protocol):
    """A kernel that is wanted, while a room above compiles it."""

    @property
    def failure(self) -> str:
        """Why it could not be compiled; empty otherwise."""
        ...

    def is_there(self) -> bool:
        """Tell whether the kernel has been compiled, looking no more often than every `PAUSE` seconds."""
        ...

    def wait(self) -> bool:
        """Wait for the kernel; return whether it has been compiled."""
        ...


class Maker(Protocol):
    """How the builder makes a kernel."""

    def __call__(self, function: Callable[..., Any], *, inlined: bool, wide: bool, rare: bool) -> Any:
        """Return what can be compiled."""
        ...


builder: Maker | None = None
"""Set in the builder alone, which compiles."""


def jit(function: Callable[P, R]) -> Callable[P, R]:
    """Compile `function`, without fast-math and without exceptions on division, for calls from Python and kernels.

    The machine code is kept on disk. Kernels don't allocate, so references to arrays are not counted: each call would
    else count every array of the tables it is given up and down, which takes longer than most kernels do.
    """
    return _made(function)


def jit_inline(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does, and always into the caller: for small functions that take whole tables.

    Handing over a table of arrays costs more than the few operations of such a function.
    """
    return _made(function, inlined=True)


def jit_look(function: Callable[P, bool]) -> Callable[P, bool]:
    """Compile as `jit_inline` does a function that tells whether a cached value still holds; it may always say no.

    With `CACHES` set to ``off`` it always does, and kernels run interpreted: the same bits come out.
    """
    return cast("Callable[P, bool]", _says_no) if caches_are_off() else _made(function, inlined=True)


def _says_no(*_args: object, **_named: object) -> bool:
    """Find nothing in a cache."""
    return False


def jit_rare(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does what few ticks need: apart from its callers, whose code for all other ticks stays together.

    So the processor has less to fetch, and the compiler less to put into others.
    """
    return _made(function, rare=True)


def jit_wide(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does, and make the same steps for several cars one instruction: the compiler takes longer."""
    return _made(function, wide=True)


def jit_long(function: Callable[P, R]) -> Callable[P, R]:
    """Compile as `jit` does a kernel of which one call may take minutes interpreted: calls wait for machine code."""
    return _made(function, patient=True)


def _made(
    function: Callable[P, R],
    *,
    inlined: bool = False,
    wide: bool = False,
    patient: bool = False,
    rare: bool = False,
) -> Callable[P, R]:
    if builder is not None:
        return builder(function, inlined=inlined, wide=wide, rare=rare)
    if never_compiled():
        return function
    return Kernel(function, patient=patient)


def is_quick(kernel: Callable[..., Any]) -> bool:
    """Tell whether calls of a kernel have gone over to machine code."""
    return isinstance(kernel, Kernel) and kernel.is_quick


def never_compiled() -> bool:
    """Tell whether kernels stay plain functions for ever."""
    off = os.environ.get("NUMBA_DISABLE_JIT", "").strip()
    return _tier() == "interpreted" or off not in ("", "0") or caches_are_off()


def caches_are_off() -> bool:
    """Tell whether kernels keep nothing from tick to tick.

    Raises
    ------
    InputError
        If the environment variable that says so says something else.
    """
    said = os.environ.get(CACHES) or "on"
    if said not in ("on", "off"):
        raise InputError("caches are on or off", file=CACHES, value=said, expected="on or off")
    return said == "off"


def waits() -> bool:
    """Tell whether a call waits until its kernel is compiled."""
    return _tier() == "compiled"


def _tier() -> str:
    """Return the tier that the environment names, the first without one; InputError for another word."""
    tier = os.environ.get(TIER) or TIERS[0]
    if tier not in TIERS:
        raise InputError("no such tier", file=TIER, value=tier, expected=" or ".join(TIERS))
    return tier


class Entry(NamedTuple):
    """A kernel that Python calls, with the kinds of its arguments."""

    kernel: Kernel[..., Any]
    kinds: tuple[Kind, ...]


@contextmanager
def listed() -> Generator[list[Entry]]:
    """Run kernels interpreted in the body; the list that is yielded has all that are called, once for each kinds."""
    entries: list[Entry] = []
    _listing.append(entries)
    try:
        yield entries
    finally:
        _listing.pop()


_listing: list[list[Entry]] = []


class Kernel(Generic[P, R]):
    """A function that runs interpreted or as machine code.

    Parameters
    ----------
    function : callable
        The function, on arrays, tuples of them, and numbers.
    patient : bool
        Whether calls wait until there is machine code.

    Attributes
    ----------
    is_quick : bool
        Whether calls have gone over to machine code.
    patient
        The same.
    """

    def __init__(self, function: Callable[P, R], *, patient: bool = False) -> None:
        update_wrapper(self, function)
        self.is_quick = False
        self.patient = patient
        self._pause = 0.0
        self._function = cast(FunctionType, function)
        self._known: dict[tuple[Kind, ...], Code | Waiting | None] = {}

    def __call__(self, *args: P.args, **named: P.kwargs) -> R:
        """Run the kernel."""
        if self.is_waiting:
            return self.interpreted(*args, **named)
        whole = self._whole(args, named)
        try:
            code = self.code(tuple([kind_of(value) for value in whole]))
        except UnfitError:
            code = None
        if code is None:
            return self.interpreted(*args, **named)
        return code.call(whole)

    @property
    def is_waiting(self) -> bool:
        """Whether there is no machine code for the last call, and it is too early to look again."""
        return self._pause > 0.0 and monotonic() < self._pause

    def interpreted(self, *args: P.args, **named: P.kwargs) -> R:
        """Run the function interpreted, as silent about numbers that are not finite as machine code is."""
        with np.errstate(all="ignore"):
            return self.py_func(*args, **named)

    def __reduce__(self) -> str:
        return self._function.__qualname__

    @cached_property
    def py_func(self) -> Callable[P, R]:
        """The function interpreted, with all that it calls."""
        function = self._function
        plain = FunctionType(
            function.__code__,
            _plain_names(function),
            function.__name__,
            function.__defaults__,
            function.__closure__,
        )
        plain.__kwdefaults__ = function.__kwdefaults__
        return cast("Callable[P, R]", plain)

    def code(self, kinds: tuple[Kind, ...]) -> Code | None:
        """Return the machine code for arguments of some kinds; None while there is none, and then see to it."""
        if _listing:
            if Entry(self, kinds) not in _listing[-1]:
                _listing[-1].append(Entry(self, kinds))
            return None
        try:
            code = self._known[kinds]
        except KeyError:
            code = self._known[kinds] = self._sought(kinds)
        if code is not None and not isinstance(code, Code):
            if code.wait() if self.patient or waits() else code.is_there():
                code = self._known[kinds] = self._sought(kinds)
            elif code.failure:
                say(f"{self._function.__name__} stays interpreted: {code.failure.splitlines()[-1]}")
                code = self._known[kinds] = None
            else:
                self._pause = monotonic() + PAUSE
        return code if isinstance(code, Code) else None

    def _sought(self, kinds: tuple[Kind, ...]) -> Code | Waiting | None:
        if not self.has_source:
            return None
        held = library.find(sources.symbol(self.key(kinds)))
        code = ABOVE.compiled(self, kinds) if held is None else Code(kinds, *held)
        if isinstance(code, Code):
            self.is_quick = True
        return code

    @property
    def has_source(self) -> bool:
        """Whether a builder finds the function in a file."""
        function = self._function
        return (
            function.__module__ != "__main__"
            and "<locals>" not in function.__qualname__
            and Path(function.__code__.co_filename).is_file()
        )

    def key(self, kinds: Sequence[Kind]) -> str:
        """Return what names the machine code for arguments of some kinds (`kernels.sources.key_of`)."""
        return sources.key_of(self.file, self.name, kinds)

    @property
    def name(self) -> str:
        """The kernel's name in its module."""
        return self._function.__qualname__

    @property
    def file(self) -> Path:
        """The source that holds the kernel."""
        return Path(self._function.__code__.co_filename)

    def _whole(self, args: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
        """Return all arguments in order, those that take any number of them as one tuple."""
        count, starred = self._shape
        if named or len(args) < count:
            filled = inspect.signature(self._function).bind(*args, **named)
            filled.apply_defaults()
            return tuple(filled.arguments.values())
        return (*args[:count], args[count:]) if starred else args

    @cached_property
    def _shape(self) -> tuple[int, bool]:
        code = self._function.__code__
        return code.co_argcount, bool(code.co_flags & inspect.CO_VARARGS)


@cache
def say(text: str) -> None:
    """Say something once on standard error, in the first process of a program alone."""
    if multiprocessing.parent_process() is None:
        print(f"dubins-traffic: {text}", file=sys.stderr, flush=True)


def _plain_names(function: FunctionType) -> dict[str, Any]:
    """Return the names that a kernel's function knows, with the interpreted functions for kernels."""
    names = function.__globals__
    known = _plain.get(id(names))
    if known is None:
        known = _plain[id(names)] = {}
        known.update(names)
        known.update({name: value.py_func for name, value in names.items() if isinstance(value, Kernel)})
    return known


_plain: dict[int, dict[str, Any]] = {}
