"""Logs: one line an event on standard error, for people on a terminal, JSON for machines."""

from __future__ import annotations

import contextlib
import io
import logging
import sys
from typing import TextIO, cast

import structlog


class Tolerant(io.TextIOBase):
    """A stream on which a line that can't be written is lost, as on a full disk: nothing fails for its log."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write what can be written."""
        with contextlib.suppress(OSError, ValueError):  # the second: it is closed
            self._stream.write(text)
        return len(text)

    def flush(self) -> None:
        """Let it go on, if it can."""
        with contextlib.suppress(OSError, ValueError):  # the second: it is closed
            self._stream.flush()


def to_stderr() -> None:
    """Let the logs of this process go to standard error."""
    shown = structlog.dev.ConsoleRenderer() if sys.stderr.isatty() else structlog.processors.JSONRenderer()
    structlog.configure(
        processors=[
            structlog.processors.add_log_level,
            structlog.processors.TimeStamper(fmt="iso", utc=True),
            structlog.processors.format_exc_info,
            shown,
        ],
        wrapper_class=structlog.make_filtering_bound_logger(logging.INFO),
        logger_factory=structlog.PrintLoggerFactory(cast("TextIO", Tolerant(sys.stderr))),
    )
