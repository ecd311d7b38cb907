"""Submissions: read with every size bounded, checked, hashed, stored whole or not at all; nothing of them is run here.

What comes from a stranger is refused before it is written anywhere: names that lead out of the folder, links, devices,
more bytes than declared, more files than anybody needs.
"""

from __future__ import annotations

import hashlib
import io
import os
import re
import stat
import tempfile
import tomllib
import unicodedata
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dubins_traffic.errors import InputError
from dubins_traffic.files import read_bytes
from dubins_traffic.problem.faults import Strict, fault, parse

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

    InputError if there is something that is no file or folder, can't be read, or is too much.
    """
    data_of: dict[str, bytes] = {}
    left = bounds.total
    try:
        for path in _walk(folder):
            name = path.relative_to(folder).as_posix()
            _check_count(len(data_of) + 1, bounds)
            data_of[_checked_name(name)] = data = _read(path, left, bounds)
            left -= len(data)
    except OSError as error:
        raise InputError(f"can't be read ({error.strerror})", file=os.fspath(error.filename or folder)) from None
    _check_names(data_of)
    return data_of


def check_apart(folder: Path, results: Path) -> None:
    """Refuse to keep results where they would become a part of what is evaluated.

    InputError if `results` lies in `folder` and would be read as a part of it.
    """
    whole, place = folder.resolve(), results.resolve()
    if folder.is_dir() and place.is_relative_to(whole) and _is_kept(place.relative_to(whole).as_posix()):
        raise InputError(
            "lies in what is evaluated",
            file=str(results),
            expected=f"a folder elsewhere, or one called {EVALUATIONS}",
        )


def zip_files(data: bytes, bounds: Bounds) -> dict[str, bytes]:
    """Return the files of a zip archive by name.

    InputError if it is damaged, encrypted, or holds anything but files and folders inside itself that are not too
    much.
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
                raise InputError("unpacks to too much", value=declared, expected=f"at most {bounds.total >> 20} MiB")
            data_of: dict[str, bytes] = {}
            for entry in entries:
                if entry.filename in data_of:
                    raise InputError("name taken", field=entry.filename, expected="each file once")
                with archive.open(entry) as file:
                    data_of[entry.filename] = file.read(entry.file_size)
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
    _check_names(data_of)
    return data_of


def without_folder(files: dict[str, bytes], wanted: frozenset[str]) -> dict[str, bytes]:
    """Return files without the one folder that all of them are in, if none of the `wanted` stands at the top."""
    tops = {name.partition("/")[0] for name in files}
    if wanted & files.keys() or len(tops) != 1 or not all("/" in name for name in files):
        return files
    return {name.partition("/")[2]: data for name, data in files.items()}


def _walk(folder: Path) -> Iterator[Path]:
    with os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda item: item.name):
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
        raise InputError("too long a name", value=name, expected=f"at most {_LONGEST_NAME} bytes, {_DEEPEST} folders")
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


MANIFEST = "controller.toml"
CONTROLLER = "controller.py"
CLASS = "Controller"
PROGRAM = "program"
"""What a program is called that is handed in as one file."""
MOST_SOURCE = 4 << 20
"""Most bytes of the file of a controller, and of the manifest."""
_NAMED = re.compile(rb"\b" + CLASS.encode() + rb"\b")
_EXPECTED = f"a {CONTROLLER} with a class {CLASS}, or a {MANIFEST}"

Kind = Literal["python", "program", "image"]


class Manifest(Strict):
    """What `controller.toml` may say, as the boxes of controllers read it."""

    python: Annotated[str, Field(pattern=r"^[\w./-]+\.py:[A-Za-z_]\w*$", max_length=200)] | None = Field(
        default=None, description="the class of a controller in Python, as `my/controller.py:Mine`"
    )
    program: Annotated[list[Annotated[str, Field(min_length=1, max_length=1000)]], Field(min_length=1)] | None = Field(
        default=None, description="a program that speaks lines, as `./drive`, and its arguments"
    )

    image: Annotated[str, Field(pattern=r"^[\w-][\w.-]*$", max_length=100)] | None = Field(
        default=None, description="the archive of a container image, which runs `program`, else its own"
    )

    @model_validator(mode="after")
    def _one(self) -> Manifest:
        if (self.python is None) == (self.program is None and self.image is None):
            raise fault("not one thing to run", "one of python, program and image")
        return self


@dataclass(frozen=True, slots=True)
class Submission:
    """A checked and stored submission."""

    digest: str
    """SHA-256 over a line ``SHA-256 name`` for each file, sorted by name. Dates and permissions do not count."""
    kind: Kind
    """``python``: a class that our shim drives; ``program``: anything else, which speaks lines; ``image``: a
    container image with such a program.
    """
    path: Path
    """The folder in which it is stored."""


def check_submission(
    source: str | os.PathLike[str] | bytes, store: str | os.PathLike[str], bounds: Bounds | None = None
) -> Submission:
    """Check a submission and store it in ``store/DIGEST``; the same again is stored once.

    Parameters
    ----------
    source : path or bytes
        A file (Python, a zip archive, a program), a folder, or what was uploaded.
    store : path
        The folder of all submissions, made if missing.
    bounds : Bounds, optional
        The most that it may hold.

    Raises
    ------
    InputError
        For the first thing wrong, caused by an OSError if it can't be stored. Nothing is left in the store then.
    """
    bounds = bounds or Bounds()
    name = "upload" if isinstance(source, bytes) else os.fspath(source)
    try:
        files = without_folder(_files(source, bounds), frozenset({MANIFEST, CONTROLLER}))
        _complete(files)
        manifest = _manifest(files)
    except InputError as error:
        raise error.within(file=name) from None
    digest = content_digest(files)
    path = Path(store) / digest
    if not path.is_dir():
        _store(files, _program_of(manifest), path)
    return _submission(digest, path, manifest)


def content_digest(files: dict[str, bytes]) -> str:
    """Return the digest of what a submission holds."""
    lines = (f"{hashlib.sha256(files[name]).hexdigest()}  {name}\n" for name in sorted(files))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def _submission(digest: str, path: Path, manifest: Manifest) -> Submission:
    kind: Kind = "image" if manifest.image else "program" if manifest.program else "python"
    return Submission(digest, kind, path)


def _files(source: str | os.PathLike[str] | bytes, bounds: Bounds) -> dict[str, bytes]:
    if not isinstance(source, bytes):
        if Path(source).is_dir():
            return folder_files(Path(source), bounds)
        suffix, data = Path(source).suffix, read_bytes(Path(source), most=bounds.upload)
    else:
        suffix, data = "", source
    if len(data) > bounds.upload:
        raise InputError("too large", value=len(data), expected=f"at most {bounds.upload >> 20} MiB")
    if data.startswith(ZIP_MAGIC):
        return zip_files(data, bounds)
    if suffix == ".zip":
        raise InputError("not a zip archive", expected="a zip archive")
    if data.startswith((b"\x7fELF", b"#!")):
        return {PROGRAM: data, MANIFEST: f'program = ["./{PROGRAM}"]\n'.encode()}
    return {CONTROLLER: data}


def _complete(files: dict[str, bytes]) -> None:
    """Add the manifest that a `controller.py` alone would have; InputError if there is nothing to run."""
    if MANIFEST in files:
        return
    if CONTROLLER not in files:
        raise InputError("nothing to run", value=sorted(files)[:10], expected=_EXPECTED)
    if not _NAMED.search(files[CONTROLLER]):
        raise InputError(f"no class {CLASS}", field=CONTROLLER, expected=_EXPECTED)
    files[MANIFEST] = f'python = "{CONTROLLER}:{CLASS}"\n'.encode()


def _manifest(files: dict[str, bytes]) -> Manifest:
    """Return the manifest of a submission, having looked at the file that it names."""
    manifest = parse(Manifest, _toml(files[MANIFEST]), field=MANIFEST)
    if manifest.python is not None:
        place = manifest.python.rpartition(":")[0]
        if place not in files:
            raise InputError("no such file", field=f"{MANIFEST}.python", value=place, expected="one in the submission")
        _check_source(place, files[place])
    if manifest.image is not None and manifest.image not in files:
        raise InputError(
            "no such file", field=f"{MANIFEST}.image", value=manifest.image, expected="one in the submission"
        )
    program = _program_of(manifest)
    if program is not None and program not in files:
        raise InputError("no such file", field=f"{MANIFEST}.program", value=program, expected="one in the submission")
    return manifest


def _toml(data: bytes) -> dict[str, object]:
    try:
        if len(data) > MOST_SOURCE:
            raise ValueError("too large")
        return tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise InputError(f"not TOML ({error})", field=MANIFEST, expected="TOML") from None


def _check_source(name: str, data: bytes) -> None:
    """Refuse what is no text; it is not parsed here, since text can be made that ends the parser's process."""
    if len(data) > MOST_SOURCE:
        raise InputError("too large", field=name, value=len(data), expected=f"at most {MOST_SOURCE >> 20} MiB")
    try:
        data.decode()
    except UnicodeDecodeError as error:
        raise InputError(f"not UTF-8 text (byte {error.start})", field=name, expected="Python") from None
    if b"\0" in data:
        raise InputError("not text", field=name, expected="Python")


def _program_of(manifest: Manifest) -> str | None:
    """Return the file of the submission that is to be executable; a word without a slash is a program elsewhere."""
    first = "" if manifest.image else (manifest.program or [""])[0]
    return first.removeprefix("./") if "/" in first else None


def _store(files: dict[str, bytes], program: str | None, path: Path) -> None:
    """Write files to a folder beside `path`, then put it in its place in one step."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".new-", dir=path.parent) as made:
            new = Path(made) / "new"
            new.mkdir()
            for name, data in files.items():
                place = new / name
                place.parent.mkdir(parents=True, exist_ok=True)
                with place.open("xb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                place.chmod(0o755 if name == program else 0o644)
            for folder in (new, *(item for item in new.rglob("*") if item.is_dir())):
                folder.chmod(0o755)
            try:
                new.rename(path)
            except OSError:
                if not path.is_dir():  # else somebody else has stored the same
                    raise
    except OSError as error:
        raise InputError(f"can't be stored ({error.strerror})", file=str(path)) from error
