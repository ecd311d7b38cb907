"""HTTP connections whose other end is slow are cut off: they hold a connection, and what the service keeps for it.

Time is counted in looks at a connection, so nobody is cut off because this process was busy.
"""

from __future__ import annotations

import asyncio

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

LOOK_S = 1.0
"""Seconds between two looks at a connection."""
PATIENCE = 20
"""Looks at which nothing has come of a request, or nothing was taken of an answer, and for which a head may take."""
SLOWEST = 4096
"""Bytes a look, of a body that comes or of an answer that is taken, beyond the first `PATIENCE` looks."""


class PatientProtocol(H11Protocol):
    """HTTP/1.1 as uvicorn speaks it, with an end to its patience."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Begin to look at a connection."""
        super().connection_made(transport)
        self._looks = self._silent = self._blocked = self._stuck = self._come = self._most = self._left = 0
        self._watch = self.loop.call_later(LOOK_S, self._look)

    def connection_lost(self, exc: Exception | None) -> None:
        """Look no more."""
        self._watch.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take some bytes; with the first of a request its time begins."""
        if self.conn.their_state is h11.IDLE and not self.conn.trailing_data[0]:
            self._looks = self._come = 0
        self._silent, self._come = 0, self._come + len(data)
        super().data_received(data)

    def pause_writing(self) -> None:
        """Note how much of an answer is to be taken."""
        self._blocked = self._stuck = 0
        self._most = self._left = self.transport.get_write_buffer_size()
        super().pause_writing()

    def resume_writing(self) -> None:
        """Note that it has been taken."""
        self._left = 0
        super().resume_writing()

    def _look(self) -> None:
        self._watch = self.loop.call_later(LOOK_S, self._look)
        left = self.transport.get_write_buffer_size()
        self._blocked, self._stuck = self._blocked + 1, 0 if left < self._left else self._stuck + 1
        self._left = min(self._left, left)
        if not self.flow.read_paused:  # else it is this end that does not take what comes
            self._looks, self._silent = self._looks + 1, self._silent + 1
        if self._is_slow():
            self.transport.abort()

    def _is_slow(self) -> bool:
        """Tell whether the other end has had its time."""
        if self._left and (self._stuck > PATIENCE or self._blocked > PATIENCE + (self._most - self._left) // SLOWEST):
            return True
        if self.conn.their_state is h11.SEND_BODY:
            return self._silent > PATIENCE or self._looks > PATIENCE + self._come // SLOWEST
        kept = self.timeout_keep_alive_task is not None  # it ends the connection itself
        return self.conn.their_state is h11.IDLE and not kept and self._looks > PATIENCE
