"""A window for moving pictures: a page in the browser that shows the newest one, and the pictures as PNG files.

No library is needed, and it works from another machine, through a tunnel, as it does at home.
"""

from __future__ import annotations

import contextlib
import struct
import webbrowser
import zlib
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Condition, Thread
from typing import Any, Final

import numpy as np

from dubins_traffic.animation.raster_kernel import Image
from dubins_traffic.viewer.pages import part

HOST: Final = "127.0.0.1"
PATIENCE: Final = 10.0
"""Seconds after which a page that waits for a picture is told that there is none, and asks again."""


def png(image: Image) -> bytes:
    """Return a picture (H, W, 3) as a PNG file; equal pictures give equal bytes."""
    height, width = image.shape[:2]
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = image.reshape(height, 3 * width)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 1)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    )


class LiveView:
    """Shows pictures in a page of the browser, the newest as soon as it is there; one is never waited for.

    Parameters
    ----------
    opens : bool
        Whether a browser is asked to show the page.

    Attributes
    ----------
    url : str
        Where the page is, on this machine only.
    """

    def __init__(self, *, opens: bool = True) -> None:
        self._changed = Condition()
        self._file = b""
        self._number = 0
        self._server = _Server((HOST, 0), partial(_Answers, self))
        self.url = f"http://{HOST}:{self._server.server_address[1]}/"
        self._thread = Thread(target=self._server.serve_forever, name="live view", daemon=True)
        self._thread.start()
        if opens:
            webbrowser.open(self.url)

    def show(self, image: Image) -> None:
        """Show a picture (H, W, 3) uint8."""
        file = png(image)
        with self._changed:
            self._file = file
            self._number += 1
            self._changed.notify_all()

    def newer(self, number: int) -> tuple[int, bytes] | None:
        """Return the newest picture's number and file as soon as it is another than `number`; None: not yet."""
        with self._changed:
            there = self._changed.wait_for(lambda: self._number not in (0, number), PATIENCE)
            return (self._number, self._file) if there else None

    def close(self) -> None:
        """End the page; it keeps showing the last picture."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


class _Server(ThreadingHTTPServer):
    daemon_threads = True
    block_on_close = False


class _Answers(BaseHTTPRequestHandler):
    def __init__(self, view: LiveView, *given: Any) -> None:
        self._view = view
        super().__init__(*given)

    def do_GET(self) -> None:
        """Answer with the page, or with a picture."""
        _, _, number = self.path.rpartition("/newer/")
        with contextlib.suppress(ConnectionError):
            if self.path == "/":
                self._answer(200, "text/html", part("animation/live.html").encode())
            elif not number.isdigit():
                self._answer(404, "text/plain", b"there is the page / and no other\n")
            else:
                newer = self._view.newer(int(number))
                if newer is None:
                    self._answer(204, "image/png", b"")
                else:
                    self._answer(200, "image/png", newer[1], newer[0])

    def _answer(self, status: int, kind: str, body: bytes, number: int = 0) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Cache-Control", "no-store")
        self.send_header("number", str(number))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Say nothing."""
