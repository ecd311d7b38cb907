"""Submissions: checked, hashed by what they hold, stored whole or not at all; nothing of them is run here."""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from dubins_traffic.competition.contents import ZIP_MAGIC, Bounds, folder_files, without_folder, zip_files
from dubins_traffic.errors import InputError
from dubins_traffic.files import read_bytes
from dubins_traffic.problem.faults import Strict, fault, parse

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
    program: (
        Annotated[list[Annotated[str, Field(min_length=1, max_length=1000)]], Field(min_length=1)] | None
    ) = Field(default=None, description="a program that speaks lines, as `./drive`, and its arguments")

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
    """A checked and stored submission.

    Attributes
    ----------
    digest : str
        SHA-256 over a line ``SHA-256  name`` for each file, sorted by name. Dates and permissions do not count.
    kind : str
        ``python``: a class that our shim drives; ``program``: anything else, which speaks lines; ``image``: a container
        image with such a program.
    path : Path
        The folder in which it is stored.
    """

    digest: str
    kind: Kind
    path: Path


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
            raise InputError(
                "no such file", field=f"{MANIFEST}.python", value=place, expected="one in the submission"
            )
        _check_source(place, files[place])
    if manifest.image is not None and manifest.image not in files:
        raise InputError(
            "no such file", field=f"{MANIFEST}.image", value=manifest.image, expected="one in the submission"
        )
    program = _program_of(manifest)
    if program is not None and program not in files:
        raise InputError(
            "no such file", field=f"{MANIFEST}.program", value=program, expected="one in the submission"
        )
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
        raise InputError(
            "too large", field=name, value=len(data), expected=f"at most {MOST_SOURCE >> 20} MiB"
        )
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
            for folder in (new, *(own for own in new.rglob("*") if own.is_dir())):
                folder.chmod(0o755)
            try:
                new.rename(path)
            except OSError:
                if not path.is_dir():  # else somebody else has stored the same
                    raise
    except OSError as error:
        raise InputError(f"can't be stored ({error.strerror})", file=str(path)) from error
