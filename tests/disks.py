"""Small disks for tests that fill them."""

from __future__ import annotations

import io
import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.tools import need


@contextmanager
def small_disk(place: Path, kibibytes: int) -> Iterator[Path]:
    """Mount a file system of so many KiB at a place."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={kibibytes}k,mode=755", "tmpfs", str(place)]
    refused = os.geteuid() != 0 or subprocess.run(command, capture_output=True, check=False).returncode
    need("the right to mount" if refused else "", "it takes root, on a machine that allows mounts")
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def fill(ballast: Path, spare: int = 0) -> None:
    """Write until nothing more goes onto the disk, or nothing but `spare` bytes."""
    with ballast.open("wb", buffering=0) as file:
        for step in (1 << 20, 4096):
            data = b"\0" * step
            while _wrote(file, data):
                pass
        file.truncate(max(0, file.tell() - spare))


def _wrote(file: io.FileIO, data: bytes) -> bool:
    try:
        return file.write(data) == len(data)
    except OSError:
        return False
