"""Classes from outside the package: ``module:Class`` or ``path/to/file.py:Class``, for every seam that takes them."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import os
import re
import sys
import zlib
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from dubins_traffic.errors import InputError, shown
from dubins_traffic.files import is_file

CLASS = "a class without arguments"


def plainly(error: BaseException) -> str:
    """Return what an exception says, in a line."""
    return shown(f"{type(error).__name__}: {error}")


@contextlib.contextmanager
def put_back() -> Generator[None]:
    """Put back after the body what code of a user's may leave changed: the current folder, and the standard streams."""
    streams = sys.stdin, sys.stdout, sys.stderr
    try:
        here = os.open(".", os.O_RDONLY | os.O_DIRECTORY)
    except OSError:  # it was removed, or may not be read
        here = None
    try:
        yield
    finally:
        sys.stdin, sys.stdout, sys.stderr = streams
        if here is not None:
            with contextlib.suppress(OSError):  # the code may have closed it
                os.fchdir(here)
                os.close(here)


@dataclass(frozen=True, slots=True)
class Seam:
    """Something of which users may have their own, given as a class.

    Attributes
    ----------
    option : str
        The option or field that names it; stands in messages.
    name : str
        What it is called: ``controller``.
    methods : tuple of str
        What it must be able to do; the last one is looked for when a class is to be proposed.
    signature : str
        The same as a line for people.
    error_text : callable
        Returns what is said of an exception that its code raised.
    """

    option: str
    name: str
    methods: tuple[str, ...]
    signature: str
    error_text: Callable[[BaseException], str] = plainly

    def refuse(self, problem: str, spec: str, expected: str) -> InputError:
        """Return the error about `spec`."""
        return InputError(problem, file=self.option, value=spec, expected=expected)


class ConstructionError(InputError):
    """The class of a user's own raised when it was to be made; the cause is what it raised."""


def is_place(spec: str) -> bool:
    """Tell whether a text says where a class is, in a module or in a file."""
    place, colon, name = spec.rpartition(":")
    return bool(colon and place and name.isidentifier())


def resolved(spec: str, folder: Path | None = None) -> str:
    """Return where a class is so that it is found from everywhere: a file by its full path.

    A relative path is looked up in `folder`, then in the current directory.
    """
    path, colon, name = spec.rpartition(":")
    if not (colon and path.endswith(".py")):
        return spec
    beside = (folder or Path()) / Path(path).expanduser()
    place = beside if is_file(beside) else Path(path).expanduser()
    return f"{place.resolve()}:{name}"


def find(spec: str, seam: Seam) -> Callable[[], Any]:
    """Return the class at ``module:Class`` or ``path/to/file.py:Class``.

    Modules are also looked up in the current directory; a file may import its neighbours.

    Raises
    ------
    InputError
        If there is no such module, file or class, or the code raises while it is loaded. Whatever it raises counts,
        `SystemExit` too; only Ctrl-C goes through.
    """
    place, _, name = spec.rpartition(":")
    with put_back():
        module = _load_file(place, spec, seam) if place.endswith(".py") else _load_module(place, spec, seam)
    made = getattr(module, name, None)
    if made is None:
        raise seam.refuse(f"no class {name} in {place}", spec, _offer(module, seam))
    if not callable(made):
        raise seam.refuse(f"{name} in {place} is not a class", spec, CLASS)
    return made


def of_packages(group: str) -> dict[str, Callable[[], Any]]:
    """Return the classes that other packages offer as entry points of a group, by name; it takes some milliseconds."""
    from importlib.metadata import entry_points

    return {
        entry.name: entry.load()
        for entry in sorted(entry_points(group=group), key=lambda entry_point: entry_point.name)
    }


def make(maker: Callable[[], Any], spec: str, seam: Seam) -> Any:
    """Return what `maker`, the class found at `spec`, makes.

    Raises
    ------
    ConstructionError
        If it raises.
    InputError
        If what it makes lacks a method of the seam.
    """
    name = spec.rpartition(":")[2]
    try:
        with put_back():
            made = maker()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raise ConstructionError(
            f"{name} raised {seam.error_text(error)} on construction",
            file=seam.option,
            value=spec,
            expected=CLASS,
        ) from error
    for method in seam.methods:
        if not callable(getattr(made, method, None)):
            raise seam.refuse(f"{name} is not a {seam.name}: it lacks the method {method}", spec, seam.signature)
    return made


def make_strictly(maker: Callable[[], Any], spec: str, seam: Seam) -> Any:
    """Do as `make`, for what a stranger's document names: only a class with the methods of the seam is called."""
    if not isinstance(maker, type):
        raise seam.refuse(f"{spec.rpartition(':')[2]} is not a class", spec, CLASS)
    for method in seam.methods:
        if not callable(getattr(maker, method, None)):
            problem = f"{maker.__name__} is not a {seam.name}: it lacks the method {method}"
            raise seam.refuse(problem, spec, seam.signature)
    return make(maker, spec, seam)


def parameters_of(made: Any, given: Mapping[str, Any], field: str) -> dict[str, Any]:
    """Return all parameters of an object, whose attribute `parameters` holds the defaults.

    Raises
    ------
    InputError
        If one is given, in the field `field`, that it does not take.
    """
    defaults = dict(getattr(made, "parameters", {}))
    for name in given:
        if name not in defaults:
            expected = f"one of {', '.join(defaults)}" if defaults else "no parameters"
            raise InputError("unknown parameter", field=field, value=name, expected=expected)
    return {**defaults, **given}


def _load_file(place: str, spec: str, seam: Seam) -> ModuleType:
    path = Path(place).expanduser()
    if not is_file(path):
        raise seam.refuse(f"no such file: {place}", spec, "path/to/file.py:Class")
    path = path.resolve()
    kind = re.sub(r"\W", "_", seam.name)
    label = f"_{kind}_{path.stem}_{zlib.crc32(str(path).encode()):x}"
    module_spec = importlib.util.spec_from_file_location(label, path)
    if module_spec is None or module_spec.loader is None:
        raise seam.refuse(f"not a Python file: {place}", spec, "path/to/file.py:Class")
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[label] = module
    _look_in(str(path.parent))
    try:
        module_spec.loader.exec_module(module)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        del sys.modules[label]
        problem = f"{place} raised {seam.error_text(error)} while it was loaded"
        raise seam.refuse(problem, spec, "a file that loads") from error
    return module


def _load_module(place: str, spec: str, seam: Seam) -> ModuleType:
    _look_in(str(Path.cwd()))
    importlib.invalidate_caches()
    try:
        return importlib.import_module(place)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is not None and (place == missing or place.startswith(missing + ".")):
            problem, expected = f"no module {place}", "module:Class that can be imported from here"
        else:
            problem, expected = (
                f"{place} raised {seam.error_text(error)} while it was loaded",
                "a module that loads",
            )
        raise seam.refuse(problem, spec, expected) from error


def _look_in(folder: str) -> None:
    if folder not in sys.path:
        sys.path.append(folder)


def _offer(module: ModuleType, seam: Seam) -> str:
    members: dict[str, Any] = vars(module)
    classes = sorted(
        name
        for name, value in members.items()
        if isinstance(value, type) and callable(getattr(value, seam.methods[-1], None))
    )
    return f"one of {', '.join(classes)}" if classes else f"a class with the methods {' and '.join(seam.methods)}"
