"""The key of sealed seeds: a passphrase, or a file that lies elsewhere than what it locks."""

from __future__ import annotations

import os
import secrets
from pathlib import Path

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text

SHORTEST_KEY = 12
"""Fewest bytes of a passphrase or a key file."""


def make_key_file(path: Path, folder: Path | None) -> None:
    """Write a new key that only its owner may read; InputError as `read_key`, or if a file is there."""
    _check_outside(path, folder)
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror})", file=str(path)) from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(32) + "\n")


def read_key(path: Path, folder: Path | None) -> bytes:
    """Return what is in a key file.

    Raises
    ------
    InputError
        If it can't be read, or lies in the folder of the competition: who copies that would have both.
    """
    _check_outside(path, folder)
    return read_text(path).strip().encode()


def _check_outside(path: Path, folder: Path | None) -> None:
    if folder is not None and path.resolve().is_relative_to(folder.resolve()):
        raise InputError(
            "a key in the folder of what it locks", file=str(path), expected="a place outside it"
        )


def checked_key(key: bytes) -> bytes:
    """Return a passphrase or key that is long enough; InputError if it is not."""
    if len(key) < SHORTEST_KEY:
        expected = f"at least {SHORTEST_KEY} bytes"
        raise InputError(
            "a key too short", field="passphrase or key file", value=f"{len(key)} bytes", expected=expected
        )
    return key
