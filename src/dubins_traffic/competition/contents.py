"""What a submission holds: the files of a folder, of a zip archive or a single one, read with every size bounded.

What comes from a stranger is refused before it is written anywhere: names that lead out of the folder, links, devices,
more bytes than declared, more files than anybody needs.
"""

from __future__ import annotations

import io
import os
import stat
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from dubins_traffic.errors import InputError

ZIP_MAGIC = b"PK\x03\x04"
_ENTRY = b"PK\x01\x02"
"""Before every entry of the directory of an archive."""
_LONGEST_NAME = 200
_DEEPEST = 16
_METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_ENCRYPTED = 1
EVALUATIONS = "evaluations"
"""Where `dubins-traffic evaluate` keeps its results unless it is told another place."""
_LEFT_OUT = frozenset({"__pycache__", "__MACOSX", EVALUATIONS})
"""Folders that tools leave behind; with names that begin with a dot they are no part of a submission."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """The most that a submission may hold: `upload` bytes as it is sent, `total` bytes unpacked, `files`."""

    upload: int = 16 << 20
    total: int = 64 << 20
    files: int = 1000


def folder_files(folder: Path, bounds: Bounds) -> dict[str, bytes]:
    """Return the files below a folder by name, with slashes; links are not followed but refused.

    Raises
    ------
    InputError
        If there is something that is no file or folder, can't be read, or is too much.
    """
    found: dict[str, bytes] = {}
    left = bounds.total
    try:
        for path in _walk(folder):
            name = path.relative_to(folder).as_posix()
            _check_count(len(found) + 1, bounds)
            found[_checked_name(name)] = data = _read(path, left, bounds)
            left -= len(data)
    except OSError as error:
        raise InputError(
            f"can't be read ({error.strerror})", file=os.fspath(error.filename or folder)
        ) from None
    _check_names(found)
    return found


def check_apart(folder: Path, results: Path) -> None:
    """Refuse to keep results where they would become a part of what is evaluated.

    Raises
    ------
    InputError
        If `results` lies in `folder` and would be read as a part of it.
    """
    own, place = folder.resolve(), results.resolve()
    if folder.is_dir() and place.is_relative_to(own) and _is_kept(place.relative_to(own).as_posix()):
        raise InputError(
            "lies in what is evaluated",
            file=str(results),
            expected=f"a folder elsewhere, or one called {EVALUATIONS}",
        )


def zip_files(data: bytes, bounds: Bounds) -> dict[str, bytes]:
    """Return the files of a zip archive by name.

    Raises
    ------
    InputError
        If it is damaged, encrypted, or holds anything but files and folders inside itself that are not too much.
    """
    if data.count(_ENTRY) > 8 * bounds.files:
        raise InputError("too many entries in the archive", expected=f"at most {bounds.files} files")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [entry for entry in archive.infolist() if _is_kept(entry.filename)]
            for entry in entries:
                _check_entry(entry)
            entries = [entry for entry in entries if not entry.is_dir()]
            _check_count(len(entries), bounds)
            declared = sum(entry.file_size for entry in entries)
            if declared > bounds.total:
                raise InputError(
                    "unpacks to too much", value=declared, expected=f"at most {bounds.total >> 20} MiB"
                )
            found: dict[str, bytes] = {}
            for entry in entries:
                if entry.filename in found:
                    raise InputError("name taken", field=entry.filename, expected="each file once")
                with archive.open(entry) as file:
                    found[entry.filename] = file.read(entry.file_size)
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        OverflowError,
        OSError,
    ) as error:
        raise InputError(f"a damaged archive ({error})", expected="a zip archive") from None
    _check_names(found)
    return found


def without_folder(files: dict[str, bytes], wanted: frozenset[str]) -> dict[str, bytes]:
    """Return files without the one folder that all of them are in, if none of the `wanted` stands at the top."""
    tops = {name.partition("/")[0] for name in files}
    if wanted & files.keys() or len(tops) != 1 or not all("/" in name for name in files):
        return files
    return {name.partition("/")[2]: data for name, data in files.items()}


def _walk(folder: Path) -> Iterator[Path]:
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda own: own.name):
            if not _is_kept(entry.name):
                continue
            kind = entry.stat(follow_symlinks=False).st_mode
            if stat.S_ISDIR(kind):
                yield from _walk(Path(entry.path))
            elif stat.S_ISREG(kind):
                yield Path(entry.path)
            else:
                raise InputError(f"a {_kind(kind)}", file=entry.path, expected="files and folders alone")


def _read(path: Path, left: int, bounds: Bounds) -> bytes:
    """Return what is in a file that is still one when it is opened, `left` bytes at most."""
    handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    with os.fdopen(handle, "rb") as file:
        if not stat.S_ISREG(os.fstat(handle).st_mode):
            raise InputError("no file any more", file=str(path))
        data = file.read(left + 1)
    if len(data) > left:
        raise InputError("too much", file=str(path), expected=f"at most {bounds.total >> 20} MiB in all")
    return data


def _check_entry(entry: zipfile.ZipInfo) -> None:
    name = entry.filename
    _checked_name(name.removesuffix("/"))
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise InputError(f"a {_kind(kind)}", field=name, expected="files and folders alone")
    if entry.flag_bits & _ENCRYPTED:
        raise InputError("encrypted", field=name, expected="an archive without a password")
    if entry.compress_type not in _METHODS:
        raise InputError(
            "packed in an unusual way", field=name, value=entry.compress_type, expected="deflated or stored"
        )


def _checked_name(name: str) -> str:
    parts = name.split("/")
    bad = (
        not name.isprintable()
        or "\\" in name
        or ":" in name
        or unicodedata.normalize("NFC", name) != name
        or any(part in ("", ".", "..") for part in parts)
    )
    if bad:
        raise InputError("not a name of a file", value=name, expected="a name inside the submission")
    if len(name.encode()) > _LONGEST_NAME or len(parts) > _DEEPEST:
        raise InputError(
            "too long a name", value=name, expected=f"at most {_LONGEST_NAME} bytes, {_DEEPEST} folders"
        )
    return name


def _check_names(files: dict[str, bytes]) -> None:
    """Refuse names that are one on some file systems, and a file where a folder must be."""
    taken: dict[str, str] = {}
    for name in files:
        other = taken.setdefault(name.casefold(), name)
        if other != name:
            raise InputError("differs from another name by case alone", value=name, expected=f"not {other}")
    for name in files:
        parts = name.split("/")
        for depth in range(1, len(parts)):
            if "/".join(parts[:depth]).casefold() in taken:
                raise InputError("in a folder that is a file", value=name, expected="names that fit together")


def _check_count(count: int, bounds: Bounds) -> None:
    if count > bounds.files:
        raise InputError("too many files", value=count, expected=f"at most {bounds.files}")


def _is_kept(name: str) -> bool:
    parts = name.split("/")
    return not any(part in _LEFT_OUT or (part.startswith(".") and part not in (".", "..")) for part in parts)


def _kind(mode: int) -> str:
    kinds = {
        stat.S_IFLNK: "link",
        stat.S_IFIFO: "pipe",
        stat.S_IFSOCK: "socket",
        stat.S_IFCHR: "device",
        stat.S_IFBLK: "device",
    }
    return kinds.get(stat.S_IFMT(mode), "special file")
