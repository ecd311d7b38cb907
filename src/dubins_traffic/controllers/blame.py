"""The text about an exception that a controller raised: one line, with the controller's own lines that led there.

The text stands in records, whose bytes must be the same on every machine: files are given by their bare names, and
folders and addresses are left out.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import TracebackType

from dubins_traffic.errors import DubinsTrafficError, shown

DEBUG = "DUBINS_TRAFFIC_DEBUG"
"""Environment variable that makes whole tracebacks of controllers be printed; `--debug` sets it."""
LINES = 3
"""Number of lines of a traceback that the text has, the last ones."""
LONGEST = 300
"""Most characters of a message."""
LONGEST_LINE = 80
"""Most characters of a line of a controller."""
_OURS = str(Path(__file__).parents[1]) + os.sep
_INSTALLED = tuple(sysconfig.get_path(name) + os.sep for name in ("purelib", "platlib"))
_PYTHON = (sysconfig.get_path("stdlib") + os.sep, "<frozen ")
_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_LABEL = re.compile(r"\b_controller_(\w+)_[0-9a-f]{1,8}\b")
_CELL = re.compile(r"ipykernel_\d+[\\/]|^<ipython-input")


def error_text(error: BaseException, tick: int | None = None) -> str:
    """Return kind and message of an error that a controller raised, its tick, and the controller's last lines.

    Examples
    --------
    >>> error_text(ValueError("lost"), 7)
    'ValueError: lost at tick 7'
    """
    when = "" if tick is None else f" at tick {tick}"
    lines = [] if isinstance(error, DubinsTrafficError) else list(_own_lines(_frames(error)))[-LINES:]
    return f"{_named(error)}{when}" + (f" ({' > '.join(lines)})" if lines else "")


def value_text(value: object, limit: int = LONGEST) -> str:
    """Return `value` as a line of text, even if its `repr` raises."""
    return _clean(_text(repr, value), limit)


def show(error: BaseException) -> None:
    """Print the whole traceback of an error that a controller raised, if `DEBUG` asks for it."""
    if os.environ.get(DEBUG):
        traceback.print_exception(error)


def _named(error: BaseException) -> str:
    message, name = _clean(_text(str, error), LONGEST), _type_name(error)
    return f"{name}: {message}" if message else name


def _type_name(value: object) -> str:
    """Return the name of a value's type, whatever its metaclass makes of that."""
    return type.__dict__["__name__"].__get__(type(value))


def _frames(error: BaseException) -> TracebackType | None:
    """Return the traceback of an exception, whatever its class makes of that."""
    return BaseException.__dict__["__traceback__"].__get__(error)


def _text(make: Callable[[object], str], value: object) -> str:
    """Return ``make(value)``, which is str or repr of a controller's object and may raise."""
    try:
        return make(value)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # str or repr of a user's object may raise anything
        return f"<{_type_name(value)} that raises {_type_name(error)} when it is printed>"


def _clean(text: str, limit: int) -> str:
    """Return `text` as one line without addresses and folders, which differ between machines."""
    text = _LABEL.sub(r"\1", _ADDRESS.sub("", text))
    if os.sep in text:
        for folder in sorted(_folders(), key=len, reverse=True):
            text = text.replace(folder, "")
    return shown(text, limit)


def _folders() -> set[str]:
    """Return the folders, each with a separator at its end, that mean something on this machine only."""
    folders: set[str] = set()
    for make in (*(Path(place).absolute for place in sys.path if place), Path.cwd, Path.home):
        with contextlib.suppress(OSError, RuntimeError):  # the current folder was removed, a home is unknown
            folders.add(str(make()))
    return {place.rstrip(os.sep) + os.sep for place in folders} - {os.sep}


def _own_lines(frames: TracebackType | None) -> Iterator[str]:
    """Yield the lines of a traceback that are the controller's own, outermost first."""
    frame_summaries: list[traceback.FrameSummary] = []
    installed: list[traceback.FrameSummary] = []
    for frame in traceback.extract_tb(frames):
        if frame.filename.startswith(_OURS):
            continue
        if frame.filename.startswith(_INSTALLED):
            installed.append(frame)
        elif not frame.filename.startswith(_PYTHON):
            frame_summaries.append(frame)
    for frame in frame_summaries or installed:
        place = "cell" if _CELL.search(frame.filename) else Path(frame.filename).name
        line = shown(frame.line or "", LONGEST_LINE)
        yield f"{shown(place, LONGEST_LINE)}:{frame.lineno} in {frame.name}" + (f": {line}" if line else "")
