"""Reading texts and writing them whole or not at all."""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from dubins_traffic.errors import InputError

STANDARD = "-"


def read_text(path: str | Path) -> str:
    """Return the UTF-8 text of a file; ``-`` reads standard input.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, may not be read or is not UTF-8.
    """
    name = str(path)
    try:
        data = sys.stdin.buffer.read() if name == STANDARD else Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError("no such file", file=name) from None
    except IsADirectoryError:
        raise InputError("a folder", file=name, expected="a file") from None
    except PermissionError:
        raise InputError("no permission to read", file=name) from None
    except (OSError, ValueError) as error:
        raise InputError(f"can't be read ({error})", file=name) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not UTF-8 text (byte {error.start})", file=name) from None


def write_text(path: str | Path, text: str) -> None:
    """Write `text` as UTF-8 to a temporary neighbour of `path`, then put it in place.

    Raises
    ------
    InputError
        If the file can't be written; then nothing is left behind and an old file is untouched.
    """
    target = Path(path)
    if target.is_dir():
        raise InputError("a folder", file=str(path), expected="a file to write")
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(prefix=f".{target.name}.", suffix=".part", dir=target.parent)
        with os.fdopen(handle, "wb") as stream:
            stream.write(text.encode("utf-8"))
        mask = os.umask(0)
        os.umask(mask)
        Path(temporary).chmod(0o666 & ~mask)
        Path(temporary).replace(target)
    except OSError as error:
        if temporary is not None:
            Path(temporary).unlink(missing_ok=True)
        reason = error.strerror or str(error)
        raise InputError(f"can't be written ({reason})", file=str(path)) from None
