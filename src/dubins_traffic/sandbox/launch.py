"""The command line that begins a box: what is seen in it, who it is, and what it may use.

Three programs follow each other. As root a shell with mounts of its own puts what the box shall see where an ordinary
user can read it, since an interpreter may lie under a folder that only root may enter, and `setpriv` becomes an
ordinary user for good; `bwrap --uid` alone would map to root. Then bubblewrap makes the namespaces. In the box a shell
sets the limits of each process, says that the box stands, and becomes the program.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from pathlib import Path
from typing import Final

from dubins_traffic.sandbox.layers import ENVIRONMENT, IPC, MEMORY, NETWORK, PIDS, RLIMITS, USERS, Layers
from dubins_traffic.sandbox.limits import Limits

SYSTEM: Final = "/usr/bin:/bin"
USER: Final = 1000
"""User and group in a box, as it sees itself."""
FIRST_USER: Final = 0x20000000
"""Boxes that root begins have users of their own from here on, who own nothing and have no name."""
OPEN_FILES: Final = 256
STAGE: Final = 1 << 30
"""Bytes of a submission's folder at most, where root has to copy it."""
OURS: Final = "/.box"
"""Where a box that sees an image has the shell that sets its limits."""
DEVICES: Final = ("null", "zero", "full", "random", "urandom")
HOST_STATE: Final = (
    *("loadavg", "stat", "uptime", "meminfo", "vmstat", "zoneinfo", "buddyinfo", "pagetypeinfo", "slabinfo"),
    *("diskstats", "swaps", "interrupts", "softirqs", "schedstat", "timer_list", "key-users", "locks"),
    *("cgroups", "sys/fs/file-nr", "sys/fs/inode-nr", "sys/fs/inode-state", "sys/fs/dentry-state"),
    *("pressure/cpu", "pressure/io", "pressure/memory", "pressure/irq"),
)
"""Files of /proc that tell how busy the host is, whatever the namespaces: no box can open them."""
SETTINGS: Final = ("ld.so.cache", "ld.so.conf", "ld.so.conf.d", "alternatives")
"""What is seen of /etc: what the dynamic linker needs."""
STANDS: Final = "dubins-traffic: the box stands"
"""The first line on standard error of a box; what comes before it is not the program's."""
_numbers = count()


@dataclass(frozen=True, slots=True)
class Shown:
    """A file or folder that a box sees, read-only: `source` of the host at `place`.

    `own`: whether it is the submission's own, of which root gives the box a copy that it can read.
    """

    source: str
    place: str
    own: bool = False


@dataclass(frozen=True, slots=True)
class Program:
    """What runs in a box: its command line as the box sees it, what it sees, and its environment.

    `shim`: whether it is ours, which is handed the problem pickled, and says when it is ready to drive. `image`:
    whether the first that it sees, at ``/``, takes the place of the system; `environment` and `folder` are its own.
    """

    command: tuple[str, ...]
    shown: tuple[Shown, ...] = ()
    environment: Mapping[str, str] = field(default_factory=dict[str, str])
    shim: bool = False
    image: bool = False
    folder: str = ""


def command_line(
    program: Program,
    limits: Limits,
    layers: Layers,
    *,
    doors: Sequence[str],
    seccomp: int,
    reports_start: bool = True,
) -> list[str]:
    """Return the command line that begins a box.

    Parameters
    ----------
    doors : sequence of str
        Files of its control group into which the first process writes its number.
    seccomp : int
        Descriptor from which bubblewrap reads the filter of system calls; -1 for none.
    reports_start : bool
        Whether the box says on standard error that it stands.
    """
    root = os.getuid() == 0 and layers.boxes
    shell = _own_shell() if program.image else ["/bin/sh"]
    inner = [*shell, "-c", _limits(limits, layers, reports_start, _entry(program)), "box"]
    if not layers.boxes:
        return _entered([*inner, *(outside(program, word) for word in program.command)], doors, ())
    inner += program.command
    places, steps = staged(program.shown) if root else (program.shown, [])
    more = ["--seccomp", str(seccomp)] if seccomp >= 0 else []
    outer = _bubblewrap(program, places, limits, layers) + more + ["--", *inner]
    if not root:
        return _entered(outer, doors, ())
    dropped = [*_setpriv(), *outer]
    if not steps:
        return _entered(dropped, doors, ())
    return [_tool("unshare"), "--mount", "--propagation", "private", "--", *_entered(dropped, doors, steps)]


def outside(program: Program, word: str) -> str:
    """Return a word of a command line, or of an environment, as it is where there is no box."""
    for each in sorted(program.shown, key=lambda shown: len(shown.place), reverse=True):
        if word.startswith(each.place):
            return each.source + word.removeprefix(each.place)
        if each.place.rpartition("/")[0] == word:
            return str(Path(each.source).parent)
    return word


def _tool(name: str) -> str:
    """Return where a tool lies: what begins a box has the system's PATH, since its first process shows it."""
    return shutil.which(name) or name


def _setpriv() -> list[str]:
    user = str(FIRST_USER + (os.getpid() % (1 << 22)) * 64 + next(_numbers) % 64)
    drop = ["--clear-groups", "--inh-caps=-all", "--bounding-set=-all", "--no-new-privs"]
    return [_tool("setpriv"), f"--reuid={user}", f"--regid={user}", *drop, "--"]


def _entered(command: Sequence[str], doors: Sequence[str], steps: Sequence[str]) -> list[str]:
    """Return `command` as a shell begins it that goes through the doors of a control group first."""
    if not doors and not steps:
        return list(command)
    lines = ["set -e", *(f"echo $$ >{shlex.quote(door)}" for door in doors), *steps, 'exec "$@"']
    return ["/bin/sh", "-c", "\n".join(lines), "box", *command]


def staged(shown: Sequence[Shown]) -> tuple[list[Shown], list[str]]:
    """Return what is shown from places that everybody can read, and the steps of a shell that put it there.

    Folders are bound, and the rest is copied: what a submission's owner can read, a box need not be able to.
    """
    stage = _stage()
    outside_box: list[Shown] = []
    binds: list[str] = []
    copies: list[str] = []
    for number, each in enumerate(shown):
        if _is_open(each):
            outside_box.append(each)
            continue
        source = shlex.quote(each.source)
        if each.own or not Path(each.source).is_dir():
            place = f"{stage}/copies/{number}"
            copies += [f"cp -R -P -- {source} {place}", f"chmod -R a+rX {place}"]
        else:
            place = f"{stage}/{number}"
            Path(place).mkdir(mode=0o755, exist_ok=True)
            binds.append(f"mount --bind {source} {place}")
        outside_box.append(Shown(place, each.place))
    if copies:
        copies.insert(0, f"mount -t tmpfs -o mode=755,nosuid,nodev,size={STAGE} box {stage}/copies")
    return outside_box, binds + copies


def _is_open(shown: Shown) -> bool:
    """Tell whether every user can read what is shown; of a submission's folder it is not known."""
    path = Path(shown.source)
    if shown.own and not path.is_file():
        return False
    try:
        modes = [folder.stat().st_mode & 0o1 for folder in path.parents]
        wanted = 0o5 if path.is_dir() else 0o4
        return all(modes) and path.stat().st_mode & wanted == wanted
    except OSError:
        return False


@cache
def _stage() -> str:
    """Return a folder with empty ones, over which a box's own mounts lie, in namespaces of their own."""
    place = "/run/dubins-traffic"
    try:
        Path(place).mkdir(mode=0o755, exist_ok=True)
    except OSError:
        place = tempfile.mkdtemp(prefix="dubins-traffic-")
        Path(place).chmod(0o755)
    (Path(place) / "copies").mkdir(mode=0o755, exist_ok=True)
    return place


def _entry(program: Program) -> list[str]:
    """Return what the shell does last: an image's environment is not to change the shell that sets the limits."""
    if not program.image:
        return []
    exports = [f"export {name}={shlex.quote(value)}" for name, value in program.environment.items()]
    return [*exports, "export HOME=/tmp TMPDIR=/tmp", f"cd {shlex.quote(program.folder)}"]


def _bubblewrap(program: Program, shown: Sequence[Shown], limits: Limits, layers: Layers) -> list[str]:
    """Return the command line of bubblewrap up to the program."""
    words = [_tool("bwrap"), "--unshare-user", "--unshare-uts", "--hostname", "box", "--unshare-cgroup-try"]
    words += ["--uid", str(USER), "--gid", str(USER), "--die-with-parent", "--new-session"]
    for option, on in (("net", NETWORK in layers), ("pid", PIDS in layers), ("ipc", IPC in layers)):
        words += [f"--unshare-{option}"] if on else []
    words += ["--disable-userns"] if USERS in layers else []
    if ENVIRONMENT in layers:
        words += ["--clearenv", "--setenv", "PATH", SYSTEM, "--setenv", "HOME", "/tmp"]
        words += ["--setenv", "TMPDIR", "/tmp", "--setenv", "LANG", "C.UTF-8"]
    if not program.image:
        for name, value in program.environment.items():
            words += ["--setenv", name, value]
        words += _system()
    for each in shown:
        words += ["--ro-bind", each.source, each.place]
    if program.image:
        words += _around_an_image()
    words += ["--proc", "/proc"] if PIDS in layers else ["--ro-bind", "/proc", "/proc"]
    words += _without_load()
    words += ["--size", str(limits.files), "--tmpfs", "/tmp", "--chdir", "/tmp"]
    return [*words, "--remount-ro", "/"]


@cache
def _without_load() -> list[str]:
    """Return the options of bubblewrap that put a device which nobody can open there over each of `HOST_STATE`."""
    paths = [path for name in HOST_STATE if (path := Path("/proc") / name).exists()]
    return [word for path in paths for word in ("--ro-bind", "/dev/null", str(path))]


@cache
def _shell_files() -> Mapping[str, str]:
    """Return the files of this machine's shell by their names in a box that sees an image."""
    said = subprocess.run(["ldd", "/bin/sh"], capture_output=True, text=True, check=False).stdout
    libraries = {"sh": str(Path("/bin/sh").resolve())}
    for line in said.splitlines():
        name, arrow, rest = line.strip().partition(" => ")
        path = (rest if arrow else name).partition(" (")[0]
        if path.startswith("/"):
            libraries[name if arrow else "ld.so"] = path
    return libraries


def _own_shell() -> list[str]:
    """Return the command of this machine's shell in a box that sees an image, which may have none."""
    shell = [f"{OURS}/sh"]
    return [f"{OURS}/ld.so", "--library-path", OURS, *shell] if "ld.so" in _shell_files() else shell


@cache
def _around_an_image() -> list[str]:
    """Return what a box has besides an image, as options of bubblewrap: devices, and the shell that sets its limits."""
    words = ["--size", "65536", "--tmpfs", "/dev", *_devices(), "--remount-ro", "/dev"]
    words += ["--size", "65536", "--tmpfs", OURS]
    for name, path in _shell_files().items():
        words += ["--ro-bind", path, f"{OURS}/{name}"]
    return [*words, "--remount-ro", OURS]


@cache
def _system() -> list[str]:
    """Return what every box sees of the system, as options of bubblewrap."""
    words = ["--ro-bind", "/usr", "/usr"]
    for name in ("bin", "sbin", "lib", "lib64", "lib32"):
        path = Path("/") / name
        if path.is_symlink():
            words += ["--symlink", str(path.readlink()), str(path)]
        elif path.is_dir():
            words += ["--ro-bind", str(path), str(path)]
    for name in SETTINGS:
        words += ["--ro-bind-try", f"/etc/{name}", f"/etc/{name}"]
    return words + _devices()


def _devices() -> list[str]:
    words: list[str] = []
    for name in DEVICES:
        words += ["--dev-bind", f"/dev/{name}", f"/dev/{name}"]
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        words += ["--symlink", f"/proc/self/fd/{number}", f"/dev/{name}"]
    return [*words, "--symlink", "/proc/self/fd", "/dev/fd", "--symlink", "/tmp", "/dev/shm"]


def _limits(limits: Limits, layers: Layers, reports_start: bool, entry: Sequence[str]) -> str:
    """Return what the shell in the box does before it becomes the program."""
    lines = ["set -e"]
    if RLIMITS in layers:
        most = {"c": 0, "n": OPEN_FILES, "f": -(-limits.files // 512), "l": 64}
        if layers.boxes:
            most["p"] = limits.processes + 1
        if MEMORY not in layers:
            most["v"] = limits.memory // 1024
        lines += [f"ulimit -{letter} {value}" for letter, value in most.items()]
    lines += [f"echo {STANDS} >&2"] if reports_start else []
    return "\n".join([*lines, *entry, 'exec "$@"'])
