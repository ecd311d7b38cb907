"""What is said of an exception that a controller raised: in one line, with the lines of its own that led there.

The line stands in records, whose bytes are the same on every machine: files go by their bare names, and where on this
machine something lies is left out.
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
"""Name of the environment variable that has all tracebacks of controllers printed; `--debug` sets it."""
LINES = 3
"""So many lines of a traceback are told, the last ones."""
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
    """Return kind and message of what a controller raised, when, and the last lines of its own that led there.

    Examples
    --------
    >>> error_text(ValueError("lost"), 7)
    'ValueError: lost at tick 7'
    """
    when = "" if tick is None else f" at tick {tick}"
    lines = [] if isinstance(error, DubinsTrafficError) else list(_own_lines(error.__traceback__))[-LINES:]
    return f"{_named(error)}{when}{_lines_text(lines)}"


def value_text(value: object, limit: int = LONGEST) -> str:
    """Return what `value` is as a line of text, whatever its `repr` does."""
    return _clean(_text(repr, value), limit)


def show(error: BaseException) -> None:
    """Print the whole traceback of what a controller raised, if that is asked for."""
    if os.environ.get(DEBUG):
        traceback.print_exception(error)


def _lines_text(lines: list[str]) -> str:
    return f" ({' > '.join(lines)})" if lines else ""


def _named(error: BaseException) -> str:
    message = _clean(_text(str, error), LONGEST)
    return f"{type(error).__name__}: {message}" if message else type(error).__name__


def _text(make: Callable[[object], str], value: object) -> str:
    """Return str or repr of something of a controller's, which may itself raise."""
    try:
        return make(value)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # what can't even be printed
        return f"<{type(value).__name__} that raises {type(error).__name__} when it is printed>"


def _clean(text: str, limit: int) -> str:
    """Return `text` as one line without what differs from machine to machine: addresses, folders."""
    text = _LABEL.sub(r"\1", _ADDRESS.sub("", text))
    if os.sep in text:
        for folder in sorted(_folders(), key=len, reverse=True):
            text = text.replace(folder, "")
    return shown(text, limit)


def _folders() -> set[str]:
    """Return the folders, each with a separator at its end, that mean something on this machine only."""
    found = {str(Path(place).absolute()) for place in sys.path if place}
    with contextlib.suppress(
        OSError, RuntimeError
    ):  # the current folder may have been removed, a home be unknown
        found |= {str(Path.cwd()), str(Path.home())}
    return {place.rstrip(os.sep) + os.sep for place in found} - {os.sep}


def _own_lines(frames: TracebackType | None) -> Iterator[str]:
    """Yield the lines of a traceback that are the controller's own, outermost first."""
    own: list[traceback.FrameSummary] = []
    installed: list[traceback.FrameSummary] = []
    for frame in traceback.extract_tb(frames):
        if frame.filename.startswith(_OURS):
            continue
        if frame.filename.startswith(_INSTALLED):
            installed.append(frame)
        elif not frame.filename.startswith(_PYTHON):
            own.append(frame)
    for frame in own or installed:
        place = "cell" if _CELL.search(frame.filename) else Path(frame.filename).name
        line = shown(frame.line or "", LONGEST_LINE)
        yield f"{shown(place, LONGEST_LINE)}:{frame.lineno} in {frame.name}" + (f": {line}" if line else "")
