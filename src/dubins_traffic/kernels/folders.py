"""Folders for machine code: a process loads it from the package, or from a folder that only its user can write."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

FOLDER = "NUMBA_CACHE_DIR"
"""The environment variable that names another folder for compiled kernels."""

TIER = "DUBINS_TRAFFIC_KERNELS"
"""The environment variable that says how kernels run."""

KEPT = "kept"
"""Its value where machine code is read from a folder that need not be one's own, and no kernel is compiled."""

OTHERS_WRITE = stat.S_IWGRP | stat.S_IWOTH
"""What a folder for machine code must not allow."""


def base_folder() -> Path:
    """Return the user's folder for compiled kernels, of all versions; it need not be there."""
    root = os.environ.get(FOLDER)
    if root:
        return Path(root)
    from platformdirs import user_cache_path

    return user_cache_path("dubins-traffic") / "kernels"


def own_folder(folder: Path) -> Path:
    """Return a folder that this user alone can write, made if missing.

    Raises
    ------
    OSError
        If others can write it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    told = folder.stat()
    if told.st_uid == os.getuid() and told.st_mode & OTHERS_WRITE:
        folder.chmod(told.st_mode & ~OTHERS_WRITE)
    if not is_private(folder):
        raise PermissionError(errno.EPERM, "others can write here", str(folder))
    return folder


def is_private(folder: Path) -> bool:
    """Tell whether a folder is there, and its user alone, or root, can change what it holds.

    Folders above it may be open to a group; one that is open to all must keep what it holds for its owners, as that for
    temporary files does.
    """
    try:
        folder = folder.resolve()
        told = folder.stat()
        above = [place.stat() for place in folder.parents]
    except OSError:
        return False
    ours = {0, os.getuid()}
    return (
        told.st_uid in ours
        and not told.st_mode & OTHERS_WRITE
        and all(
            place.st_uid in ours and (not place.st_mode & stat.S_IWOTH or bool(place.st_mode & stat.S_ISVTX))
            for place in above
        )
    )
