"""Libraries of machine code: one file for a level of processors holds all kernels and needs no compiler to be loaded.

A library lies in the package, as wheels have it, or in a folder that its user alone can write, where `dubins-traffic
build` puts it. Beside it stands a manifest: for which sources it was built, and the hash of the file. A kernel is found
by the hash of its source and of all that it imports, and by the kinds of its arguments; so of a library that was built
of other sources only what has stayed the same is used.
"""

from __future__ import annotations

import ast
import ctypes
import hashlib
import json
import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

from dubins_traffic.kernels.folders import KEPT, TIER, base_folder, is_private
from dubins_traffic.kernels.kinds import Kind
from dubins_traffic.kernels.levels import levels
from dubins_traffic.kernels.sources import PACKAGE, makers_hash

IN_PACKAGE = PACKAGE / "machine"
"""The folder of the package that holds libraries, in wheels."""
BUILT = "library"
"""The folder in that of compiled kernels in which a user's own library lies."""


class Library:
    """A library that has been loaded; it stays as long as the process.

    Parameters
    ----------
    path : Path
        The file.
    answers : mapping
        The kind of what each function returns, written down.
    """

    def __init__(self, path: Path, answers: dict[str, str]) -> None:
        self._code = ctypes.CDLL(str(path))
        self._answers = answers

    def find(self, symbol: str) -> tuple[Kind, int] | None:
        """Return the kind of a kernel's answer and the address of its function; None if it is not in the library."""
        answer = self._answers.get(symbol)
        if answer is None:
            return None
        address = ctypes.cast(getattr(self._code, symbol), ctypes.c_void_p).value
        return None if address is None else (ast.literal_eval(answer), address)


def find(symbol: str) -> tuple[Kind, int] | None:
    """Return the kind of a kernel's answer and the address of its function, of the first library that has it."""
    for library in libraries():
        held = library.find(symbol)
        if held is not None:
            return held
    return None


@cache
def libraries() -> tuple[Library, ...]:
    """Return the library in the package, and the one that the user has built, as far as there are any that fit."""
    if not levels():
        return ()
    loaded = [_best(IN_PACKAGE)]
    folder = base_folder() / BUILT
    if os.environ.get(TIER) == KEPT or is_private(folder):
        loaded.append(_best(folder))
    return tuple(library for library in loaded if library is not None)


def _best(folder: Path) -> Library | None:
    """Return the library in a folder of the best level that runs here, if it is whole."""
    for name in levels():
        try:
            text = (folder / f"{name}.json").read_bytes()
        except OSError:
            continue
        loaded = _loaded(folder, text)
        if loaded is not None:
            return loaded
    return None


def _loaded(folder: Path, text: bytes) -> Library | None:
    """Return the library of a manifest; None if it was built by other rules, or is damaged, which is said."""
    try:
        manifest: dict[str, Any] = json.loads(text)
        if manifest["makers"] != makers_hash():
            return None
        path = folder / Path(manifest["file"]).name
        if hashlib.sha256(path.read_bytes()).hexdigest() != manifest["sha256"]:
            raise ValueError("its hash is another")
        return Library(path, {symbol: kernel["answer"] for symbol, kernel in manifest["kernels"].items()})
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        _say_damaged(folder, error)
        return None


@cache
def _say_damaged(folder: Path, error: Exception) -> None:
    print(f"dubins-traffic: the library of compiled kernels in {folder} can't be used: {error}", file=sys.stderr)
