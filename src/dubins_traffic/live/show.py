"""What pages are sent of a trial: its first frame, and a log of ticks and messages that each reads at its own pace.

Nothing is ever left out of the log, and whoever runs the trial never waits for a page: one that is slow, or opened
late, gets more ticks at a time.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from threading import Lock
from typing import Any, Final

import numpy as np

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.kernels.arrays import Floats

CHUNK: Final = 1 << 18
"""Most bytes of ticks in one message to a page, but for a single tick."""


class Show:
    """One trial as pages see it.

    Parameters
    ----------
    number : int
        Its number among the trials of this program, by which a page says which it shows.
    document : Mapping
        What the page of a replay is given, of the first frame (`viewer.replay.document_of`).
    """

    def __init__(self, number: int, document: Mapping[str, Any]) -> None:
        self.number, self.document = number, document
        self._log: list[bytes | str] = []
        self._lock = Lock()
        self._over = False

    def tell(self, message: Mapping[str, Any]) -> None:
        """Append a message to the log."""
        self._append(json.dumps(message, separators=(",", ":"), allow_nan=False))

    def tick(self, tick: int, state: State, labels: Labels, origin: Floats) -> None:
        """Append frame `tick` of one trial, (1, N) arrays, to the log, relative to `origin` (2,).

        Its form: the tick and then, of all cars, x, y, heading, speed, yaw rate, segment, disc that holds the centre,
        and flags; each of 4 bytes, the lowest first, integers from the segment on.
        """
        reals = np.stack(
            [
                state.x[0] - origin[0],
                state.y[0] - origin[1],
                np.arctan2(state.s[0], state.c[0]),
                state.speed[0],
                state.yaw_rate[0],
            ]
        )
        whole = np.stack([labels.segment[0], labels.at[0], labels.bits[0].astype(np.int64)])
        parts = (np.array([tick], "<u4"), reals.astype("<f4"), whole.astype("<u4"))
        self._append(b"".join(part.tobytes() for part in parts))

    def finish(self) -> None:
        """Append nothing more."""
        with self._lock:
            self._over = True

    def after(self, place: int) -> tuple[list[bytes | str], int, bool]:
        """Return what follows the first `place` entries of the log: messages to send, the next place, whether all.

        "All" is true once nothing more will follow. Ticks in a row make one message, of at most `CHUNK` bytes.
        """
        with self._lock:
            entries, over = self._log[place : place + 4096], self._over
            is_last = over and place + len(entries) == len(self._log)
        messages: list[bytes | str] = []
        joined = bytearray()
        for entry in entries:
            if isinstance(entry, str) or len(joined) + len(entry) > CHUNK:
                if joined:
                    messages.append(bytes(joined))
                joined = bytearray()
            if isinstance(entry, str):
                messages.append(entry)
            else:
                joined += entry
        if joined:
            messages.append(bytes(joined))
        return messages, place + len(entries), is_last

    def _append(self, entry: bytes | str) -> None:
        with self._lock:
            self._log.append(entry)
