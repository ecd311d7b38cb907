"""Submissions that a worker has unpacked: kept while they are used, and removed by age and by size.

Who uses one holds a lock on its folder, so several workers share a place and none takes from another what it runs.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import shutil
import time
from collections.abc import Generator
from pathlib import Path

from dubins_traffic.competition.submission import Submission, check_submission

AGE_S = 86400.0
"""What has not been used for so long is removed."""
MOST = 2 << 30
"""Bytes of all together, beyond which what was used longest ago is removed."""
AWAY = ".old-"
"""With this begins the name of a folder that is being removed."""
PAUSE_S = 60.0
"""Seconds between two looks at all of them."""


class Unpacked:
    """The submissions unpacked in a folder, which is made if missing.

    Parameters
    ----------
    age, most : float and int
        Seconds without use, and bytes, that are kept at most; what is in use is kept in any case.
    """

    def __init__(self, folder: Path, *, age: float = AGE_S, most: int = MOST) -> None:
        self._folder, self._age, self._most = folder, age, most
        self._looked = time.monotonic() - PAUSE_S

    @contextlib.contextmanager
    def held(self, data: bytes) -> Generator[Submission]:
        """Check and unpack what a team has sent, and keep it while the body runs; InputError as `check_submission`."""
        if time.monotonic() - self._looked >= PAUSE_S:
            self._looked = time.monotonic()
            self.clear()
        while True:
            submission = check_submission(data, self._folder)
            handle = _locked(submission.path, fcntl.LOCK_SH)
            if handle is not None:
                break
        try:
            os.utime(submission.path)
            yield submission
        finally:
            os.close(handle)

    def clear(self) -> None:
        """Remove what is too old, and of the rest what was used longest ago while all are too large.

        What a worker had put out of the way, and that was killed before it was removed, goes first.
        """
        for path in self._folder.glob(f"{AWAY}*"):
            shutil.rmtree(path, ignore_errors=True)  # another worker may be removing it
        oldest = sorted((used, path) for path in self._paths() if (used := _used(path)) is not None)
        sizes = {path: _size(path) for _, path in oldest}
        total, now = sum(sizes.values()), time.time()
        for used, path in oldest:
            if (now - used > self._age or total > self._most) and _remove(path):
                total -= sizes[path]

    def _paths(self) -> list[Path]:
        if not self._folder.is_dir():
            return []
        return [path for path in self._folder.iterdir() if path.is_dir() and not path.name.startswith(".")]


def _locked(path: Path, how: int) -> int | None:
    """Return a descriptor of a folder with a lock; None if it is gone, or in use by somebody who does not wait."""
    try:
        handle = os.open(path, os.O_RDONLY | os.O_DIRECTORY)
    except FileNotFoundError:
        return None
    with contextlib.suppress(FileNotFoundError, BlockingIOError):
        fcntl.flock(handle, how)
        if os.path.samestat(os.fstat(handle), path.stat()):
            return handle
    os.close(handle)
    return None


def _remove(path: Path) -> bool:
    """Remove a folder that nobody uses; return whether it is gone. It goes out of the way in one step."""
    handle = _locked(path, fcntl.LOCK_EX | fcntl.LOCK_NB)
    if handle is None:
        return False
    try:
        away = path.with_name(f"{AWAY}{path.name}")
        path.rename(away)
        shutil.rmtree(away)
    finally:
        os.close(handle)
    return True


def _used(path: Path) -> float | None:
    """Return when a folder was used last, None if it is gone."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return None


def _size(path: Path) -> int:
    """Return the bytes of the files in a folder that are there."""
    total = 0
    for folder, _, names in os.walk(path):
        for name in names:
            with contextlib.suppress(FileNotFoundError):
                total += (Path(folder) / name).lstat().st_size
    return total
