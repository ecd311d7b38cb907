"""A video that is written picture by picture, by PyAV."""

from __future__ import annotations

import importlib
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, Self

from dubins_traffic.animation.raster_kernel import Image
from dubins_traffic.errors import needs

CODECS: Final[dict[str, tuple[str, str, dict[str, str]]]] = {
    ".mp4": ("mp4", "libx264", {"crf": "27", "preset": "medium", "tune": "animation"}),
    ".webm": ("webm", "libvpx-vp9", {"crf": "36", "b": "0", "deadline": "realtime", "cpu-used": "6"}),
}
"""Of videos by their suffix: the container, the codec and its options."""


def library(name: str) -> Any:
    """Return the library that a moving picture needs; MissingExtraError if it is not installed."""
    with needs("a GIF" if name == "PIL" else "a video", "video"):
        return importlib.import_module(name)


class Video:
    """A video in a file; complete once it is closed. Equal pictures give equal bytes with equal versions of PyAV.

    Parameters
    ----------
    file : Path
        The file, which is written over.
    suffix : str
        Of `CODECS`: what kind of video it is.
    fps : float
        Pictures a second.
    size : (int, int)
        Width and height, pixels; the codecs want even numbers, so a row or column more is left out.

    Raises
    ------
    MissingExtraError
        If PyAV is not installed.
    """

    def __init__(self, file: Path, suffix: str, fps: float, size: tuple[int, int]) -> None:
        container, codec, options = CODECS[suffix]
        self._av = library("av")
        bare = {"fflags": "+bitexact"} | ({"movflags": "+faststart"} if container == "mp4" else {})
        self._file: Any = self._av.open(str(file), "w", format=container, options=bare)
        self._stream = self._file.add_stream(codec, rate=Fraction(fps).limit_denominator(1000), options=options)
        self._stream.width, self._stream.height = (side // 2 * 2 for side in size)
        self._stream.pix_fmt = "yuv420p"

    def add(self, image: Image) -> None:
        """Append a picture, (H, W, 3) uint8."""
        even = image[: self._stream.height, : self._stream.width]
        self._file.mux(self._stream.encode(self._av.VideoFrame.from_ndarray(even, format="rgb24")))

    def close(self) -> None:
        """Write what is left, and close the file."""
        self._file.mux(self._stream.encode())
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:  # what the codec would say of a broken video must not hide why it is broken
            self._file.close()
