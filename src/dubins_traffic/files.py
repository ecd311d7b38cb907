"""Reading texts and writing them whole or not at all."""

from __future__ import annotations

import contextlib
import gzip
import io
import os
import shutil
import sys
import tempfile
import threading
import zlib
from collections.abc import Callable, Generator, Sequence
from pathlib import Path

from dubins_traffic.errors import DubinsTrafficError, InputError

try:
    import fcntl
except ImportError as error:
    raise DubinsTrafficError("this system has no locks for files (fcntl): Linux or macOS is needed") from error

STANDARD = "-"
MOST_BYTES = 1 << 28
"""Most bytes of a document, 256 MiB: some hundred times the largest road network."""
GZIP, GZIP_MAGIC = ".gz", b"\x1f\x8b"
"""Suffix of files that are packed by gzip, and what these begin with."""
LOCK = ".lock"
"""Name of the file that is locked where a folder can't be."""


def read_bytes(path: str | Path, *, most: int = MOST_BYTES, magic: bytes = b"") -> bytes:
    """Return what is in a file or a pipe, read once from its beginning; ``-`` reads standard input.

    Parameters
    ----------
    path : str or Path
        What to read.
    most : int
        Most bytes; what holds more is refused, so that nothing is read for ever.
    magic : bytes
        What it begins with; of anything else no more is read than these first bytes, which are returned.

    Raises
    ------
    InputError
        If there is no such file, it is a folder, may not be read, or holds more than `most`.
    """
    name = str(path)
    try:
        with contextlib.ExitStack() as opened:
            stream = sys.stdin.buffer if name == STANDARD else opened.enter_context(Path(path).open("rb"))
            data = stream.read(len(magic))
            if data == magic:
                data += stream.read(most + 1 - len(magic))
    except FileNotFoundError:
        raise InputError("no such file", file=name) from None
    except IsADirectoryError:
        raise InputError("a folder", file=name, expected="a file") from None
    except PermissionError:
        raise InputError("no permission to read", file=name) from None
    except (OSError, ValueError, MemoryError) as error:
        raise InputError(f"can't be read ({error})", file=name) from None
    if len(data) > most:
        raise InputError("too large, or without an end", file=name, expected=f"at most {most >> 20} MiB")
    return data


def is_file(path: str | Path) -> bool:
    """Tell whether there is a file at a path, whatever the path; one that can't be one names none."""
    with contextlib.suppress(OSError, ValueError):
        return Path(path).is_file()
    return False


def exists(path: str | Path) -> bool:
    """Tell whether there is anything at a path, whatever the path."""
    with contextlib.suppress(OSError, ValueError):
        return Path(path).exists()
    return False


def begins_with(path: str | Path, magic: bytes) -> bool:
    """Tell whether the file at a path can be read and begins with `magic`."""
    try:
        with Path(path).open("rb") as file:
            return file.read(len(magic)) == magic
    except OSError:
        return False


def is_stream(path: str | Path) -> bool:
    """Tell whether a path is of something that can be read once only: a pipe, a device."""
    return exists(path) and not is_file(path) and not Path(path).is_dir()


def read_text(path: str | Path) -> str:
    """Return the UTF-8 text of a file, which may be packed by gzip; ``-`` reads standard input.

    Raises
    ------
    InputError
        As `read_bytes` and `decoded`.
    """
    return decoded(read_bytes(path), str(path))


def decoded(data: bytes, name: str) -> str:
    """Return the text that `data` is in UTF-8, packed by gzip or not; InputError, naming the file, if it is none."""
    try:
        return unpacked(data, name).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"not UTF-8 text (byte {error.start})", file=name) from None


def unpacked(data: bytes, name: str) -> bytes:
    """Return what gzip has packed in `data`; data that does not begin as gzip does is returned as it is.

    Raises
    ------
    InputError
        If it is damaged, or unpacks to more than `MOST_BYTES`; no more than these are unpacked.
    """
    if not data.startswith(GZIP_MAGIC):
        return data
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(data)) as packed:
            content = packed.read(MOST_BYTES + 1)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"not what gzip packs ({error})", file=name, expected="a whole file") from None
    if len(content) > MOST_BYTES:
        raise InputError("unpacks to too much", file=name, expected=f"at most {MOST_BYTES >> 20} MiB")
    return content


def write_text(path: str | Path, text: str, *, durable: bool = False) -> None:
    """Write `text` as UTF-8, whole or not at all; packed by gzip where the path ends in ``.gz``.

    Raises
    ------
    InputError
        As `replace_file`.
    """
    data = text.encode("utf-8")
    if Path(path).suffix.lower() == GZIP:
        data = gzip.compress(data, mtime=0)
    replace_file(Path(path), lambda neighbour: neighbour.write_bytes(data), durable=durable)


def replace_file(path: Path, write: Callable[[Path], object], *, durable: bool = False) -> None:
    """Let `write` make a temporary neighbour of `path`, then put it in the place of `path` in one step.

    A link stays one: what it leads to is replaced. What is no file, a device or a pipe, stays what it is: it is written
    to, once all is made.

    With `durable` it has reached the disk before it takes that place, and the place itself before this returns, so
    that not even a loss of power leaves half a file.

    Raises
    ------
    InputError
        If the file can't be written; nothing is left behind then, and an old file is untouched.
    """
    if path.is_dir():
        raise InputError("a folder", file=str(path), expected="a file to write")
    if is_stream(path):
        _write_to_stream(path, write)
        return
    name, path = path, Path(os.path.realpath(path))
    neighbour = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_native_id()}.tmp")
    try:
        write(neighbour)
        if durable:
            _flush(neighbour)
        neighbour.replace(path)
        if durable:
            _flush(path.parent)
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror or error})", file=str(name)) from error
    finally:
        with contextlib.suppress(OSError):
            neighbour.unlink(missing_ok=True)


def _write_to_stream(path: Path, write: Callable[[Path], object]) -> None:
    """Let `write` make a file, and write what is in it to a device or a pipe."""
    try:
        with tempfile.TemporaryDirectory() as folder:
            made = Path(folder) / (path.name or "made")
            write(made)
            with made.open("rb") as source, path.open("wb") as stream:
                shutil.copyfileobj(source, stream)
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror or error})", file=str(path)) from error


def require_place(path: Path) -> None:
    """Refuse a path to which no file could be written later, before there is work to lose.

    Parameters
    ----------
    path : Path
        Where a file is to be written.

    Raises
    ------
    InputError
        If a folder is there, or its folder is missing or may not be written to.
    """
    folder = path.parent
    if path.is_dir():
        raise InputError("a folder", file=str(path), expected="a file to write")
    if not folder.is_dir():
        raise InputError("no such folder", file=str(path), value=str(folder), expected="a folder to write to")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise InputError("no permission to write", file=str(path), expected="a folder to write to")


def require_output(
    path: str | os.PathLike[str],
    what: str,
    suffixes: Sequence[str],
    *,
    overwrite: bool = False,
    apart_from: Sequence[str | os.PathLike[str] | None] = (),
) -> None:
    """Refuse a path that a file of some kind may not be written to: the one rule for all that users have us write.

    A device or a pipe may always be written to, it loses nothing. A file's name must end as such files do, and so must
    the name of what it leads to, if it is a link. A file that is there is replaced only if `overwrite` is given, and
    one that is read, or that is another output, never is, whatever it is called here.

    Parameters
    ----------
    path : path
        Where the file is to be written.
    what : str
        What it is to be, for the message.
    suffixes : sequence of str
        How names of such files end, in lower case.
    overwrite : bool
        Whether a file that is there may be replaced.
    apart_from : sequence of path
        What is read, and what else is written; None, and what names no file, is passed over.

    Raises
    ------
    InputError
        If it is refused, or as `require_place`.
    """
    target, name = Path(path), str(path)
    if is_stream(target):
        return
    require_place(target)
    for place in dict.fromkeys((target, Path(os.path.realpath(target)))):
        if not place.name.lower().endswith(tuple(suffixes)):
            value = place.suffix if place == target else f"a link to {place}"
            expected = f"a name that ends in {', '.join(suffixes)}"
            raise InputError(f"not a name of {what}", file=name, value=value, expected=expected)
    for other in apart_from:
        if other is not None and _is_same_file(target, Path(other)):
            raise InputError("is read or written already", file=name, expected="another name")
    if exists(target) and not overwrite:
        raise InputError("exists already", file=name, expected="a new name, or --overwrite")


def _is_same_file(one: Path, other: Path) -> bool:
    """Tell whether two paths lead to one file, which need not be there yet."""
    if exists(one) and exists(other):
        return one.samefile(other)
    return os.path.realpath(one) == os.path.realpath(other)


def packed(*suffixes: str) -> tuple[str, ...]:
    """Return suffixes, and the same of files that are packed by gzip, as `write_text` writes them."""
    return (*suffixes, *(f"{suffix}{GZIP}" for suffix in suffixes))


def make_folder(folder: Path, what: str, *, begun: bool = False) -> None:
    """Make a folder unless it is there.

    Parameters
    ----------
    folder : Path
        Where.
    what : str
        What it is to hold, for the message.
    begun : bool
        Whether what it holds is to be gone on with, so that it must be there.

    Raises
    ------
    InputError
        If that can't be done.
    """
    if begun and not folder.is_dir():
        raise InputError("nothing to go on with", file=str(folder), expected=f"a folder that holds {what}")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"can't hold {what} ({error.strerror})", file=str(folder), expected="a folder, or a place for one"
        ) from None


@contextlib.contextmanager
def locked(folder: Path) -> Generator[None]:
    """Hold the lock of a folder; the system lets go of it when this process ends, however it ends.

    The lock is on the folder itself, or where its file system has no such locks on a file `.lock` in it.

    Raises
    ------
    InputError
        If another process holds it, or there is no such folder.
    """
    with contextlib.ExitStack() as held:
        for name, flags in ((folder, os.O_RDONLY), (folder / LOCK, os.O_RDWR | os.O_CREAT)):
            try:
                descriptor = os.open(name, flags, 0o644)
                held.callback(os.close, descriptor)
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                raise InputError("in use by another process", file=str(folder)) from None
            except OSError as error:
                if name != folder or not folder.is_dir():
                    raise InputError(f"can't be locked ({error.strerror})", file=str(folder)) from None
        yield


def _flush(path: Path) -> None:
    """Wait until a file or a folder has reached the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
