"""Runs an attack in a box: reads it from standard input and says what it has got. Nothing of the package is loaded."""

import ctypes
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

answers = os.dup(1)
os.dup2(2, 1)
libc = ctypes.CDLL(None, use_errno=True)


MODULES = (signal, socket, struct, subprocess, threading)
"""What attacks use beside what is used here."""


def call(number: int, *arguments: Any) -> int:
    """Make a system call; OSError if it fails."""
    converted = [ctypes.c_long(each) if isinstance(each, int) else each for each in arguments]
    result: int = libc.syscall(ctypes.c_long(number), *converted)
    if result == -1:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))
    return result


def text(path: str, most: int = 4096) -> str:
    """Return the beginning of a file."""
    with Path(path).open("rb") as file:
        return file.read(most).decode(errors="replace")


def say(message: dict[str, str]) -> None:
    """Answer."""
    os.write(answers, json.dumps(message).encode() + b"\n")


def spin(seconds: float) -> None:
    """Use processor time."""
    until = time.process_time() + seconds
    while time.process_time() < until:
        pass


def main() -> None:
    """Take one attack and say what came of it."""
    sys.stdin.buffer.readline()
    say({"ready": "yes"})
    asked = json.loads(sys.stdin.buffer.readline())
    names: dict[str, Any] = {**globals(), "bait": asked["bait"], "got": None}
    try:
        exec(asked["source"], names)
    except BaseException as error:
        say({"stopped": f"{type(error).__name__}: {error}"[:200]})
    else:
        say({"got": repr(names["got"])[:200]} if names["got"] else {"stopped": "nothing there"})
    sys.stdin.buffer.readline()


if __name__ == "__main__":
    main()
