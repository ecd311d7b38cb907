"""Moving pictures of at most 255 colours, GIF and PNG, in which each picture stores what has changed alone."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt

from dubins_traffic.animation.raster_kernel import Image

CLEAR: Final = 255
"""Number of the colour that stands for a pixel that has not changed."""
GIF_RATE: Final = 50.0
"""Most pictures a second: browsers slow down those with more."""
HASTE: Final = 6
"""Level of compression of a PNG: higher ones take long and gain little."""

Bytes = npt.NDArray[np.uint8]


class Change(NamedTuple):
    """What a picture changes of the one before."""

    left: int
    top: int
    pixels: Bytes
    """Numbers of colours, (h, w); `CLEAR` where nothing changes."""
    since: int
    """Number of the picture."""


class Colours:
    """A palette of 255 colours, and the nearest of them to any colour.

    Parameters
    ----------
    samples : sequence of (H, W, 3) uint8
        Pictures: the colours that most of their pixels have become those of the palette.
    """

    def __init__(self, samples: Sequence[Image]) -> None:
        seen = [np.unique(_packed(image), return_counts=True) for image in samples]
        colours, row = np.unique(np.concatenate([one for one, _ in seen]), return_inverse=True)
        weight = np.zeros(len(colours))
        np.add.at(weight, row, np.concatenate([counts for _, counts in seen]))
        chosen = colours[np.argsort(-weight, kind="stable")[:CLEAR]]
        self.rgb: Bytes = np.zeros((256, 3), dtype=np.uint8)
        self.rgb[: len(chosen)] = _unpacked(chosen)
        self._count = len(chosen)
        self._number = np.full(1 << 24, -1, dtype=np.int16)

    def numbers(self, image: Image) -> Bytes:
        """Return the numbers of the colours nearest to those of a picture, (H, W)."""
        packed = _packed(image)
        number = self._number[packed]
        if (number < 0).any():
            fresh = np.unique(packed[number < 0])
            apart = _unpacked(fresh)[:, None].astype(np.int32) - self.rgb[None, : self._count]
            self._number[fresh] = (apart * apart).sum(axis=2).argmin(axis=1)
            number = self._number[packed]
        return number.astype(np.uint8)


def changes(pictures: Iterator[Image], colours: Colours) -> Iterator[Change]:
    """Return what each picture changes; one that changes nothing is passed over."""
    last: Image | None = None
    canvas: Bytes = np.zeros((0, 0), dtype=np.uint8)
    for number, image in enumerate(pictures):
        if last is None:
            canvas = colours.numbers(image)
            last = image
            yield Change(0, 0, canvas.copy(), number)
            continue
        differs = (image != last).reshape(len(image), -1)
        last = image
        rows, columns = np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0)) // 3
        if len(rows) == 0:
            continue
        top, bottom, left, right = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        pixels = colours.numbers(image[top:bottom, left:right])
        before = canvas[top:bottom, left:right]
        change = np.where(pixels == before, np.uint8(CLEAR), pixels)
        before[...] = pixels
        yield Change(int(left), int(top), change, number)


def _timed(changes: Iterator[Change], total: int) -> Iterator[tuple[Change, int]]:
    """Return each change with the number of pictures for which it is shown."""
    held: Change | None = None
    for change in changes:
        if held is not None:
            yield held, change.since - held.since
        held = change
    if held is not None:
        yield held, total - held.since


def write_gif(pictures: Iterator[Image], samples: Sequence[Image], total: int, fps: float) -> Iterator[bytes]:
    """Return the parts of a GIF that shows so many pictures again and again; it needs Pillow."""
    from PIL import GifImagePlugin
    from PIL import Image as Pictures

    encode: Any = GifImagePlugin.getdata
    colours = Colours(samples)
    height, width = samples[0].shape[:2]
    yield b"GIF89a" + struct.pack("<HHBBB", width, height, 0xF7, 0, 0) + colours.rgb.tobytes()
    yield b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00"
    for change, shown in _timed(changes(pictures, colours), total):
        end = change.since + shown
        hundredths = round(100.0 * end / fps) - round(100.0 * change.since / fps)
        image = Pictures.fromarray(change.pixels)
        yield b"\x21\xf9\x04" + struct.pack("<BHBB", 0b00101, min(hundredths, 65535), CLEAR, 0)
        yield from encode(image, offset=(change.left, change.top), interlace=0)
    yield b"\x3b"


def write_png(pictures: Iterator[Image], samples: Sequence[Image], total: int, fps: float) -> Iterator[bytes]:
    """Return the parts of an animated PNG that shows so many pictures again and again."""
    colours = Colours(samples)
    height, width = samples[0].shape[:2]
    parts: list[bytes] = []
    count, order = 0, 0
    for change, shown in _timed(changes(pictures, colours), total):
        high, wide = change.pixels.shape
        end = change.since + shown
        thousandths = min(round(1000.0 * end / fps) - round(1000.0 * change.since / fps), 65535)
        place = (wide, high, change.left, change.top, thousandths, 1000, 0, 1)
        rows = np.zeros((high, 1 + wide), dtype=np.uint8)
        rows[:, 1:] = change.pixels
        data = zlib.compress(rows.tobytes(), HASTE)
        parts.append(_chunk(b"fcTL", struct.pack(">IIIIIHHBB", order, *place)))
        if count > 0:
            order += 1
        parts.append(_chunk(b"fdAT", struct.pack(">I", order) + data) if count > 0 else _chunk(b"IDAT", data))
        count, order = count + 1, order + 1
    yield b"\x89PNG\r\n\x1a\n" + _chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0))
    yield _chunk(b"acTL", struct.pack(">II", count, 0))
    yield _chunk(b"PLTE", colours.rgb.tobytes()) + _chunk(b"tRNS", b"\xff" * CLEAR + b"\x00")
    yield from parts
    yield _chunk(b"IEND", b"")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def _packed(image: Image) -> npt.NDArray[np.int32]:
    red, green, blue = (image[..., k].astype(np.int32) for k in range(3))
    return (red << 16) | (green << 8) | blue


def _unpacked(colours: npt.NDArray[np.int32]) -> Bytes:
    return np.stack([colours >> 16, colours >> 8 & 255, colours & 255], axis=1).astype(np.uint8)
