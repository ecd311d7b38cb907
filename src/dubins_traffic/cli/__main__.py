"""The program `dubins-traffic`, and `python -m dubins_traffic.cli`: Ctrl-C is a line from here on, not a traceback."""

from __future__ import annotations

import sys

TYPE_CHECKING = False
if TYPE_CHECKING:  # what a program loads before it hears Ctrl-C is kept small
    from types import TracebackType


def _tell(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Tell in a line of a Ctrl-C that came before `main` hears it, and of all else as Python does."""
    if issubclass(kind, KeyboardInterrupt):
        print("dubins-traffic: interrupted", file=sys.stderr)
    else:
        sys.__excepthook__(kind, error, traceback)


sys.excepthook = _tell

from dubins_traffic.cli.main import main  # noqa: E402

if __name__ == "__main__":
    raise SystemExit(main())
