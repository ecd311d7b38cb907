"""Where submissions and replays lie: a local folder, or any store that obstore has an address for, such as S3.

What is kept is called by its SHA-256, so that writing it twice is writing it once.
"""

from __future__ import annotations

import hashlib
from datetime import timedelta
from pathlib import Path
from typing import Final

from obstore.exceptions import BaseError
from obstore.store import LocalStore, from_url

from dubins_traffic.errors import DubinsTrafficError

RETRIES: Final = 4
PATIENCE: Final = timedelta(seconds=20)
"""How long a store beyond a network is asked again, before who waits for it is told; it may come again then."""


class StorageError(DubinsTrafficError):
    """The store is full, away, or has not what it should have."""


class Storage:
    """Keeps bytes under their SHA-256.

    Parameters
    ----------
    place : str
        A folder, made if missing, or an address such as ``s3://bucket/folder``; keys and regions are those of the
        environment, as obstore reads them.
    """

    def __init__(self, place: str) -> None:
        if place.startswith(("file:", "memory:")):
            self._store = from_url(place)
        elif "://" in place:
            self._store = from_url(place, retry_config={"max_retries": RETRIES, "retry_timeout": PATIENCE})
        else:
            self._store = LocalStore(Path(place).resolve(), mkdir=True)

    def put(self, data: bytes, kind: str) -> str:
        """Keep bytes of a kind (`submissions`, `replays`), and return their SHA-256.

        StorageError if they can't be kept; nothing of them is seen then.
        """
        digest = hashlib.sha256(data).hexdigest()
        try:
            self._store.put(_key(kind, digest), data)
        except (BaseError, OSError) as error:
            raise StorageError(f"the store takes nothing: {_first_line(error)}") from error
        return digest

    def get(self, digest: str, kind: str) -> bytes:
        """Return what is kept under a SHA-256.

        StorageError if it is not there, is away, or is no longer what it was.
        """
        try:
            data = bytes(self._store.get(_key(kind, digest)).bytes())
        except FileNotFoundError as error:
            raise StorageError(f"{kind}: {digest} is not in the store") from error
        except (BaseError, OSError) as error:
            raise StorageError(f"the store gives nothing: {_first_line(error)}") from error
        if hashlib.sha256(data).hexdigest() != digest:
            raise StorageError(f"{kind}: {digest} is damaged in the store")
        return data


def _key(kind: str, digest: str) -> str:
    return f"{kind}/{digest[:2]}/{digest}"


def _first_line(error: BaseException) -> str:
    return str(error).strip().partition("\n")[0]
