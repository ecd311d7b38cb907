"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from dubins_traffic.errors import InputError


def replace_file(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` make a temporary neighbour of `path`, then put it in the place of `path` in one step.

    Raises
    ------
    InputError
        If the file can't be written; nothing is left behind.
    """
    neighbour = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        write(neighbour)
        neighbour.replace(path)
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", file=str(path)) from error
    finally:
        neighbour.unlink(missing_ok=True)
