"""Container images that drive: podman reads the archive of one and flattens it, and a box runs what is in it.

Podman runs nothing here: a container of its own would have other limits than a box. The files of an image become the
root of a box, read-only, with the same layers as every box.
"""

from __future__ import annotations

import contextlib
import errno
import gzip
import hashlib
import json
import os
import shutil
import subprocess
import tarfile
import tempfile
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import IO, Final

import platformdirs

from dubins_traffic.errors import InputError, shown

MOST: Final = 512 << 20
"""Bytes of an image at most, unpacked."""
MOST_FILES: Final = 50_000
WAIT: Final = 300.0
"""Seconds that podman has for one step."""
KEPT_S: Final = 7 * 86400.0
"""Seconds for which an unpacked image is kept that nobody uses; no trial takes so long."""
OURS: Final = ("proc", "dev", "tmp", ".box")
"""Folders at the top of an image that a box covers with its own."""
PACKED_OTHERWISE: Final = (b"\x28\xb5\x2f\xfd", b"\xfd7zXZ", b"BZh")
OPTIONS: Final = (
    *("--storage-driver", "vfs", "--storage-opt", "vfs.ignore_chown_errors=true"),
    *("--events-backend", "none", "--cgroup-manager", "cgroupfs"),
)
"""How podman keeps images as root and as an ordinary user alike."""
NO_ROOM: Final = b"no space left on device"
_STEP: Final = 1 << 20
_EXPECTED: Final = "an archive of one image, as `podman save` writes it"


@dataclass(frozen=True, slots=True)
class Image:
    """An image that has been unpacked."""

    root: str
    """The folder of its files."""
    command: tuple[str, ...]
    """What it runs unless told otherwise."""
    environment: Mapping[str, str]
    """Its environment."""
    folder: str
    """Where it runs."""


def unpacked(archive: Path, store: Path | None = None) -> Image:
    """Return the image in an archive, unpacked once.

    Parameters
    ----------
    archive : Path
        As ``podman save`` writes it, of docker's or of OCI's kind; its layers may be packed by gzip.
    store : Path, optional
        Where unpacked images are kept; by default in the user's cache.

    Raises
    ------
    InputError
        If podman is not there or does not work, or there is no such image in the archive.
    """
    store = store or Path(platformdirs.user_cache_dir("dubins-traffic")) / "images"
    try:
        with archive.open("rb") as file:
            place = store / hashlib.file_digest(file, "sha256").hexdigest()
        if not place.is_dir():
            store.mkdir(parents=True, exist_ok=True)
            _remove_unused(store)
            _unpack(archive, store, place)
        os.utime(place)
        document = json.loads((place / "image.json").read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"can't be unpacked ({error.strerror})", file=str(archive)) from error
    command, environment = tuple(document["command"]), document["environment"]
    return Image(str(place / "root"), command, environment, document["folder"])


def why_not() -> str:
    """Return why images can't be unpacked on this machine, "" if they can."""
    program = shutil.which("podman")
    return "podman is not installed" if program is None else _why_not(program)


@cache
def _why_not(_program: str) -> str:
    """Return why a podman that is installed is of no use."""
    with tempfile.TemporaryDirectory(prefix="dubins-traffic-") as folder:
        try:
            _Podman(Path(folder), folder)("info")
        except InputError as error:
            return f"podman does not work here: {error.problem}"
    return ""


class _Podman:
    """Podman with a store of its own, in which nobody else's images are; a second folder must have a `short` name."""

    def __init__(self, folder: Path, short: str) -> None:
        self._folder = folder
        kept = ("--root", str(folder / "store"), "--runroot", short)
        self._command = ("podman", *kept, *OPTIONS)

    def __call__(self, *words: str) -> str:
        """Return what podman says; InputError if it says no, OSError if it has no room."""
        home = str(self._folder)
        environment = {
            "HOME": home,
            "TMPDIR": home,
            "XDG_RUNTIME_DIR": home,
            "PATH": os.environ.get("PATH", os.defpath),
        }
        try:
            done = subprocess.run(
                [*self._command, *words],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=WAIT,
                check=False,
                env=environment,
                cwd=home,
            )
        except subprocess.TimeoutExpired:
            raise InputError("podman takes too long", field=words[0]) from None
        if NO_ROOM in done.stderr.lower():
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines() or ["it does not say why"]
            raise InputError(shown(lines[0], 200), field=f"podman {words[0]}", expected=_EXPECTED)
        return done.stdout.decode(errors="replace").strip()


def _remove_unused(store: Path) -> None:
    """Remove images that nobody has used for so long that no box can see them any more."""
    for path in store.iterdir():
        with contextlib.suppress(FileNotFoundError):  # another process may be removing it
            if path.stat().st_mtime < time.time() - KEPT_S:
                shutil.rmtree(path)


def _unpack(archive: Path, store: Path, place: Path) -> None:
    if why_not():
        raise InputError(
            f"a container image can't be run here: {why_not()}",
            file=archive.name,
            expected="no image, or podman",
        )
    _check_size(archive)
    with (
        tempfile.TemporaryDirectory(prefix=".new-", dir=store) as name,
        tempfile.TemporaryDirectory(prefix="dt-") as short,
    ):
        made = Path(name)
        (made / "podman").mkdir()
        (made / "new").mkdir()
        config = _flattened(_Podman(made / "podman", short), archive, made / "files.tar")
        _extract(made / "files.tar", made / "new" / "root")
        described = json.dumps(asdict(_described(config)))
        (made / "new" / "image.json").write_text(described, encoding="utf-8")
        for folder in (made / "new", made / "new" / "root"):
            folder.chmod(0o755)
        try:
            (made / "new").rename(place)
        except OSError:
            if not place.is_dir():  # else somebody else has unpacked the same
                raise


def _flattened(podman: Callable[..., str], archive: Path, target: Path) -> Mapping[str, object]:
    """Let podman read an image and write its files; return what is said of it."""
    try:
        podman("load", "--quiet", "--input", str(archive.resolve()))
        images = set(podman("images", "--quiet", "--no-trunc").split())
        if len(images) != 1:
            raise InputError("not one image", value=len(images), expected=_EXPECTED)
        image = images.pop()
        config = json.loads(podman("image", "inspect", image))[0]["Config"]
        container = podman("create", "--network=none", "--pull=never", image, "/none")
        podman("export", "--output", str(target), container)
    finally:
        for words in (("rm", "--all", "--force"), ("rmi", "--all", "--force")):
            with suppress(InputError, OSError):
                podman(*words)
    return config


def _described(config: Mapping[str, object]) -> Image:
    def words(name: str) -> Sequence[str]:
        value = config.get(name)
        return [str(word) for word in value] if isinstance(value, list) else []  # pyright: ignore[reportUnknownVariableType, reportUnknownArgumentType]

    pairs = (text.partition("=") for text in words("Env"))
    environment = {name: value for name, _, value in pairs if name.isidentifier() and name.isascii()}
    command = (*words("Entrypoint"), *words("Cmd"))
    return Image("", command, environment, str(config.get("WorkingDir") or "/"))


def _check_size(archive: Path) -> None:
    """Refuse an archive that unpacks to too much, before podman unpacks it."""
    left = MOST
    try:
        with archive.open("rb") as file, tarfile.open(fileobj=file, mode="r|") as members:
            for member in members:
                data = members.extractfile(member) if member.isreg() else None
                if data is not None:
                    left -= _size(_inflated(data), left)
                if left < 0:
                    raise InputError("unpacks to too much", expected=f"at most {MOST >> 20} MiB")
    except (tarfile.TarError, EOFError, zlib.error, OSError) as error:
        raise InputError(f"no image ({error})", file=archive.name, expected=_EXPECTED) from None


def _inflated(file: IO[bytes]) -> IO[bytes]:
    """Return what is packed in a file by gzip; else the file."""
    begin = file.peek(8) if hasattr(file, "peek") else b""  # pyright: ignore[reportAttributeAccessIssue, reportUnknownVariableType, reportUnknownMemberType]
    if bytes(begin).startswith(PACKED_OTHERWISE):  # pyright: ignore[reportUnknownArgumentType]
        raise InputError("packed in an unusual way", expected="gzip, or not packed")
    return gzip.GzipFile(fileobj=file) if bytes(begin).startswith(b"\x1f\x8b") else file  # pyright: ignore[reportReturnType, reportUnknownArgumentType]


def _size(file: IO[bytes], most: int) -> int:
    """Return how much is in a file; not much more than `most` is read."""
    size = 0
    while size <= most and (data := file.read(_STEP)):
        size += len(data)
    return size


def _extract(source: Path, root: Path) -> None:
    """Write the files of an image, readable by all, and make the folders that a box covers."""
    root.mkdir()
    with tarfile.open(source) as archive:
        members = archive.getmembers()
        if len(members) > MOST_FILES:
            raise InputError("too many files", value=len(members), expected=f"at most {MOST_FILES}")
        try:
            archive.extractall(root, members, filter=_kept)
        except (tarfile.TarError, OSError) as error:
            raise InputError(f"no files of an image ({error})", expected=_EXPECTED) from error
    for name in OURS:
        place = root / name
        if place.is_symlink() or not place.is_dir():
            place.unlink(missing_ok=True)
            place.mkdir()
    if (root / "etc").is_symlink():
        raise InputError("/etc is a link", expected="a folder /etc, or none")
    (root / "etc" / "ld.so.preload").unlink(missing_ok=True)  # what it names would run before the limits are set


def _kept(member: tarfile.TarInfo, root: str) -> tarfile.TarInfo | None:
    """Return an entry as it is written: inside the root, nobody's own, no device."""
    if not (member.isreg() or member.isdir() or member.issym() or member.islnk()):
        return None
    member = tarfile.tar_filter(member, root)
    if member.islnk():
        target = os.path.realpath(Path(root) / member.linkname)
        if not Path(target).is_relative_to(os.path.realpath(root)):
            raise InputError("a link out of the image", value=member.name, expected="links inside the image")
    mode = 0o755 if member.isdir() or (member.mode or 0) & 0o111 else 0o644
    return member.replace(mode=mode, uid=os.getuid(), gid=os.getgid(), uname="", gname="", deep=False)
