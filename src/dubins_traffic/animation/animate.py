"""Moving pictures of a recorded trial: frames of the raster painter as GIF, PNG, MP4 or WebM."""

from __future__ import annotations

import base64
import importlib
import math
import os
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from dubins_traffic.animation.indexed import GIF_RATE, write_gif, write_png
from dubins_traffic.animation.raster import NO_MARKS, SIZES, Raster, picture_size
from dubins_traffic.animation.raster_kernel import MARKS, Image
from dubins_traffic.cars.state import EGO, NONE
from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import replace_file, require_output
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Problem
from dubins_traffic.record.reader import Record
from dubins_traffic.scoring.verdict import Verdict
from dubins_traffic.viewer.marks import goal_visits

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


SUFFIXES: Final = (".gif", ".png", *CODECS)
"""How names of moving pictures end."""
FPS: Final = 10.0
"""Default pictures a second of a GIF or a PNG, whose pictures are stored one by one."""
VIDEO_FPS: Final = 30.0
"""Default pictures a second of a video."""
SIZE: Final = 480
"""Default pixels of the longer side."""
MOST_FPS: Final = 120.0
MOST_PICTURES: Final = 100_000
"""Most pictures of one animation: nearly three hours of a GIF."""

Progress = Callable[[int, int], object]


def animate(
    record: Record,
    *,
    fps: float = FPS,
    speed: float = 1.0,
    start: float | None = None,
    stop: float | None = None,
    size: int = SIZE,
    verdict: Verdict | None = None,
) -> Animation:
    """Return moving pictures of a recorded trial.

    Parameters
    ----------
    record : Record
        The trial.
    fps : float
        Pictures a second, when played; a GIF and a PNG can have 50 at most.
    speed : float
        Seconds of the trial that pass in a second of playing.
    start, stop : float, optional
        The first and the last second of the trial that is shown; by default all of it is.
    size : int
        Pixels of the longer side of the pictures; the shorter one follows from the roads.
    verdict : Verdict, optional
        The verdict on the trial: its breaches are marked on the roads, besides contacts.

    Returns
    -------
    Animation
        The pictures, which are painted when they are asked for; a notebook plays it.

    Raises
    ------
    InputError
        If an argument is out of its range, or nothing of the trial lies between `start` and `stop`.

    Examples
    --------
    >>> import dubins_traffic as dt                                     # doctest: +SKIP
    >>> animation = dt.animate(dt.load_record("trial.mcap"), speed=4)   # doctest: +SKIP
    >>> animation.write("trial.gif")                                    # doctest: +SKIP
    """
    return Animation(record, fps=fps, speed=speed, start=start, stop=stop, size=size, verdict=verdict)


class Animation:
    """Moving pictures of a recorded trial, as `animate` returns them.

    `len` is the number of pictures. Iterating paints them one after another, each (H, W, 3) uint8; equal records give
    equal pictures.
    """

    def __init__(
        self,
        record: Record,
        *,
        fps: float,
        speed: float,
        start: float | None,
        stop: float | None,
        size: int,
        verdict: Verdict | None,
    ) -> None:
        frames = record.frames
        if len(frames) == 0:
            raise InputError("nothing to show", file=record.file, field="frames", value=0, expected="at least one")
        _require_within("--fps", fps, 0.1, MOST_FPS)
        _require_within("--speed", speed, 0.01, 1000.0)
        _require_within("--size", size, *SIZES)
        first, last = frames.first / frames.rate, (frames.first + len(frames) - 1) / frames.rate
        begin, end = first if start is None else start, last if stop is None else stop
        for name, second in (("--from", begin), ("--to", end)):
            if not first <= second <= last:
                expected = f"a second of the trial, {first:g} to {last:.7g}"
                raise InputError("outside the trial", file=record.file, field=name, value=second, expected=expected)
        if end < begin:
            raise InputError("before --from", field="--to", value=end, expected=f"at least {begin:g}")
        count = math.floor((end - begin) * fps / speed + 1e-9) + 1
        if count > MOST_PICTURES:
            expected = f"at most {MOST_PICTURES} pictures; --speed, --fps, --from and --to change their number"
            raise InputError("too many pictures", field="pictures", value=count, expected=expected)
        self.fps = fps
        self._frames, self._problem = frames, record.instance.problem
        self._seconds = begin + np.arange(count) * (speed / fps)
        self._numbers = np.minimum(np.round(self._seconds * frames.rate).astype(int) - frames.first, len(frames) - 1)
        self._shape = picture_size(self._problem, size)
        self._visits = goal_visits(record.instance, frames)
        self._marks = _all_marks(record, verdict)

    def __len__(self) -> int:
        return len(self._numbers)

    def __repr__(self) -> str:
        width, height = self._shape
        return f"<Animation: {len(self)} pictures of {width} x {height} pixels, {self.fps:g} a second>"

    def __iter__(self) -> Iterator[Image]:
        return self._paint(range(len(self)))

    def _paint(self, pictures: Sequence[int]) -> Iterator[Image]:
        """Paint some of the pictures, by their numbers in order of time."""
        frames, (width, height) = self._frames, self._shape
        raster = Raster(self._problem, width=width, height=height)
        lit = _Lit(self._problem, self._visits)
        for picture in pictures:
            number = int(self._numbers[picture])
            x, y, c, s = (
                np.ascontiguousarray(column[number], dtype=np.float64)
                for column in (frames.x, frames.y, frames.c, frames.s)
            )
            seen = lit.at(number, int(frames.at[number, EGO]))
            yield raster.frame(x, y, c, s, lit=seen, marks=self._marks_at(float(self._seconds[picture])))

    def _marks_at(self, second: float) -> Floats:
        """Return what has been marked so far, with ages in seconds of playing time of the trial."""
        if len(self._marks) == 0:
            return NO_MARKS
        marks = self._marks[self._marks[:, 3] <= second + 1e-9].copy()
        marks[:, 3] = second - marks[:, 3]
        return marks

    def write(self, path: str | os.PathLike[str], *, overwrite: bool = False, progress: Progress | None = None) -> None:
        """Write the pictures to a file: GIF, PNG (animated), MP4 or WebM, by its suffix.

        Parameters
        ----------
        path : path
            The file to write; it appears only when complete. Equal animations give equal bytes with equal versions of
            the libraries.
        overwrite : bool
            Whether a file that is there may be replaced.
        progress : callable, optional
            Called with the numbers of pictures done and in all.

        Raises
        ------
        InputError
            If the suffix is none of these, `path` is refused (`files.require_output`), or the file can't be written.
        MissingExtraError
            If the file needs a library that is not installed: a GIF Pillow, a video PyAV.
        """
        require_moving(path, overwrite=overwrite)
        target = Path(path)
        suffix = target.suffix.lower()

        def pictures() -> Iterator[Image]:
            for done, image in enumerate(self):
                yield image
                if progress is not None:
                    progress(done + 1, len(self))

        if suffix in CODECS:
            replace_file(target, lambda draft: self._write_video(draft, suffix, pictures()))
            return
        if self.fps > GIF_RATE:
            expected = f"at most {GIF_RATE:g} for a file {suffix}"
            raise InputError("too many pictures a second", field="--fps", value=self.fps, expected=expected)
        write = write_gif if suffix == ".gif" else write_png
        replace_file(
            target,
            lambda draft: draft.write_bytes(b"".join(write(pictures(), self._samples(), len(self), self.fps))),
        )

    def _samples(self) -> list[Image]:
        """Return some of the pictures, whose colours are those of all, nearly."""
        return list(self._paint(sorted({0, len(self) // 3, 2 * len(self) // 3, len(self) - 1})))

    def _write_video(self, draft: Path, suffix: str, pictures: Iterator[Image]) -> None:
        with Video(draft, suffix, self.fps, self._shape) as video:
            for image in pictures:
                video.add(image)

    def _repr_html_(self) -> str:
        data = b"".join(write_png(iter(self), self._samples(), len(self), min(self.fps, GIF_RATE)))
        text = base64.b64encode(data).decode("ascii")
        return f'<img alt="A trial, moving" style="max-width:100%" src="data:image/png;base64,{text}">'


class _Lit:
    """Which goals are lit, frame after frame: those visited in the round under way, and the one the ego is in."""

    def __init__(self, problem: Problem, visits: Sequence[tuple[int, int]]) -> None:
        self._goals = frozenset(problem.goal_vertices)
        self._visits = visits
        self._next = 0
        self._done: set[int] = set()

    def at(self, frame: int, at: int) -> list[int]:
        """Return the lit goals in a frame, not before the last one asked for, in which the ego is in disc `at`."""
        while self._next < len(self._visits) and self._visits[self._next][0] <= frame:
            self._done.add(self._visits[self._next][1])
            self._next += 1
            if self._goals.issubset(self._done):
                self._done.clear()
        return sorted(self._done | ({at} & self._goals if at != NONE else set()))


def require_moving(
    path: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    apart_from: Sequence[str | os.PathLike[str] | None] = (),
    others: Sequence[str] = (),
) -> None:
    """Refuse a path that no moving picture may be written to (`files.require_output`), or without what it needs.

    Names that end as `others` do are taken, too.
    """
    require_output(path, "a moving picture", (*SUFFIXES, *others), overwrite=overwrite, apart_from=apart_from)
    suffix = Path(path).suffix.lower()
    if suffix in CODECS:
        library("av")
    elif suffix == ".gif":
        library("PIL")


def _require_within(field: str, value: float, least: float, most: float) -> None:
    if not least <= value <= most:
        raise InputError("out of range", field=field, value=value, expected=f"{least:g} to {most:g}")


def _all_marks(record: Record, verdict: Verdict | None) -> Floats:
    """Return contacts and breaches as rows of x, y, kind and the second in which they came, in order."""
    marks = [(one.x, one.y, MARKS.CONTACT, one.time) for one in record.frames.contacts]
    names = record.instance.names
    for one in () if verdict is None else verdict.violations:
        kind = MARKS.OWN if one.car == names[EGO] else MARKS.OTHERS
        marks.append((one.where.x, one.where.y, kind, one.time))
    return np.array(sorted(marks, key=lambda mark: mark[3]), dtype=np.float64).reshape(-1, 4)
