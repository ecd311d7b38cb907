"""A kernel of its own for a test, in a machine that QEMU emulates; it sees this machine's files and can't write them.

Its control groups are those of version 2, with all controllers, whatever those of this machine are. Its processor is
always the same, and its clock counts instructions: however busy this machine is, a second there is as much work.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from tests.tools import need

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "kernel"
PROGRAM = "qemu-system-x86_64"
MACHINE = "-accel tcg -cpu Nehalem -icount shift=0 -m 1G -nodefaults -no-user-config -display none -no-reboot"
"""No processor but the emulated one counts: it is the least that NumPy takes. An instruction lasts a nanosecond."""
FILES = "local,path=/,mount_tag=machine,security_model=none,readonly=on,multidevs=remap"
KERNEL = "console=ttyS0 quiet loglevel=1 panic=-1 mitigations=off"
LIMIT_S = 6 * 3600.0
"""Far more than all attacks take: the guest has limits of its own, by its own clock."""
DONE = "guest: status"
BEGIN = """#!/bin/bash
mount -t proc proc /proc
mount -t sysfs sys /sys
mount -t cgroup2 cgroup2 /sys/fs/cgroup
mkdir -p /dev/shm
ln -s /proc/self/fd /dev/fd
mount -t tmpfs -o mode=1777 tmpfs /dev/shm
mount -t tmpfs -o mode=1777 tmpfs /run
"""
EMPTIED = ("/tmp", "/var/tmp")
"""Folders of which it sees nothing, but for the project and its interpreter, where these lie there."""
READY = "ip link set lo up 2>/dev/null\ncd /tmp\n"
SITUATIONS = {
    "root": "",
    "beside": """
mkdir /sys/fs/cgroup/slice
echo +memory +pids >/sys/fs/cgroup/cgroup.subtree_control
echo +memory +pids >/sys/fs/cgroup/slice/cgroup.subtree_control
mkdir /sys/fs/cgroup/slice/session
echo $$ >/sys/fs/cgroup/slice/session/cgroup.procs
""",
    "ordinary": """
mkdir -p /sys/fs/cgroup/user/session
echo +memory +pids >/sys/fs/cgroup/cgroup.subtree_control
chown -R 65533 /sys/fs/cgroup/user
echo $$ >/sys/fs/cgroup/user/session/cgroup.procs
""",
}
"""How control groups lie when a command begins: in the root, beside a session of systemd's, or handed to a user."""


def require() -> None:
    """Leave the test out where there is no QEMU or no kernel for it; in continuous integration it fails."""
    here = shutil.which(PROGRAM) is not None and (FOLDER / "initrd").is_file()
    need(
        "" if here else f"{PROGRAM} or {FOLDER}",
        "scripts/system-packages.sh and scripts/kernel.sh install it",
    )


def run(command: Sequence[str], situation: str, *, user: int = 0) -> tuple[int, str]:
    """Run a command under a kernel of its own; return its status and what it has said.

    Parameters
    ----------
    command : sequence of str
        The command line.
    situation : str
        Of `SITUATIONS`.
    user : int
        Who runs it.
    """
    drop = ("setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups") if user else ()
    words = shlex.join([*drop, *command])
    opened = _opened(Path(sys.base_prefix)) if user else ""
    kept = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin", "HOME": "/tmp", "PYTHONDONTWRITEBYTECODE": "1"}
    kept["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    sets = "".join(f"export {name}={shlex.quote(value)}\n" for name, value in kept.items())
    with tempfile.NamedTemporaryFile("w", prefix="guest-", suffix=".sh", dir="/var/tmp") as script:
        script.write(
            f"{BEGIN}{_emptied()}{READY}{sets}{SITUATIONS[situation]}{opened}\n{words}\n"
            f"echo {DONE} $?\necho b >/proc/sysrq-trigger\nsleep 600\n"
        )
        script.flush()
        Path(script.name).chmod(0o755)
        starts = {"-kernel": FOLDER / "vmlinuz", "-initrd": FOLDER / "initrd"}
        starts |= {"-append": f"{KERNEL} script={script.name}", "-virtfs": FILES, "-serial": "stdio"}
        options = [str(word) for pair in starts.items() for word in pair]
        done = subprocess.run(
            ["setpriv", "--pdeathsig", "KILL", PROGRAM, *MACHINE.split(), *options],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=LIMIT_S,
            check=False,
        )
    said, found, rest = done.stdout.decode(errors="replace").replace("\r", "").rpartition(DONE)
    assert found, rest
    return int(rest.split()[0]), said


def _emptied() -> str:
    """Return the steps that empty the folders in EMPTIED, but for what is needed."""
    needed = [own for own in sorted({ROOT, Path(sys.prefix)}) if any(own.is_relative_to(place) for place in EMPTIED)]
    needed = [own for own in needed if not any(other in own.parents for other in needed)]
    steps = [f"mkdir /run/kept-{k} && mount --bind {own} /run/kept-{k}" for k, own in enumerate(needed)]
    steps += [f"mount -t tmpfs -o mode=1777 tmpfs {place}" for place in EMPTIED]
    steps += [f"mkdir -p {own} && mount --move /run/kept-{k} {own}" for k, own in enumerate(needed)]
    return "\n".join([*steps, ""])


def _opened(folder: Path) -> str:
    """Return the steps that let everybody enter a folder below one that is closed, as that of an interpreter may be."""
    closed = [own for own in folder.parents if not own.stat().st_mode & 0o1]
    if not closed:
        return ""
    steps = (
        "mkdir /tmp/open",
        f"mount --bind {folder} /tmp/open",
        f"mount -t tmpfs -o mode=755 tmpfs {closed[-1]}",
    )
    return "\n".join(["", *steps, f"mkdir -p {folder}", f"mount --move /tmp/open {folder}"])
