"""What this machine can enforce, found by trying, and which mechanism enforces it."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Final

from dubins_traffic.errors import InputError, shown
from dubins_traffic.sandbox import cgroups, seccomp

WAIT: Final = 60.0
"""Seconds within which a probe of a mechanism ends, on however busy a machine."""
INSTALL: Final = "scripts/system-packages.sh, or apt-get install bubblewrap libseccomp2"


@dataclass(frozen=True, slots=True)
class Layers:
    """The layers of a box, each on or off. Only a test takes one away from those that hold.

    Parameters
    ----------
    files, network, pids, ipc : bool
        Namespaces, by bubblewrap: the box sees files, network, processes and shared memory of its own.
    users : bool
        Whether user namespaces can't be made in the box (bubblewrap's ``--disable-userns``).
    seccomp : bool
        The allow-list of system calls, by libseccomp.
    rlimits : bool
        The kernel's limits on each process and user.
    memory, processes, clock : bool
        A control group limits memory and processes, and counts processor time.
    environment : bool
        Whether the environment is its own.
    judge : bool
        Whether this process looks at what is said and used, and ends what uses more than it may.
    why : str
        Why bubblewrap can't be used, if it can't.
    """

    files: bool = True
    network: bool = True
    pids: bool = True
    ipc: bool = True
    users: bool = True
    seccomp: bool = True
    rlimits: bool = True
    memory: bool = True
    processes: bool = True
    clock: bool = True
    environment: bool = True
    judge: bool = True
    why: str = ""

    def without(self, *names: str) -> Layers:
        """Return the others."""
        return replace(self, **dict.fromkeys(names, False))

    @property
    def boxes(self) -> bool:
        """Whether there is a box at all."""
        return self.files

    def missing(self) -> list[str]:
        """Return what can't be enforced here, as lines for people; a stranger's program is refused then."""
        found: list[str] = []
        if not self.files:
            found.append(f"no box: bubblewrap can't be used: {self.why}")
        if not self.seccomp:
            found.append("no filter of system calls: libseccomp2 and pyseccomp are needed")
        return found

    def require(self) -> None:
        """Refuse a machine on which a stranger's program can't be held.

        Raises
        ------
        InputError
            That says what can't be enforced.
        """
        missing = self.missing()
        if missing:
            raise InputError(
                "; ".join(missing), file="--sandbox", expected=f"{INSTALL}; or --trust-submissions"
            )

    def held(self) -> Iterator[tuple[str, str]]:
        """Yield each limit and the mechanism that enforces it on this machine, "" for none."""
        group = f"cgroup v{cgroups.trees().version}"
        box = "bubblewrap" if self.boxes else ""
        yield "files of the host", f"{box}: mount namespace, read-only" if box else ""
        yield "processes of the host", f"{box}: pid namespace, a /proc of its own" if box else ""
        yield "network, abstract sockets", f"{box}: network namespace" if box else ""
        yield "shared memory, queues", f"{box}: ipc namespace" if box else ""
        yield "environment", f"{box}: cleared" if box else "cleared"
        yield "user", _user() if box else ""
        yield "system calls", "seccomp: allow-list of libseccomp" if self.seccomp else ""
        yield (
            "memory",
            f"{group}: memory" if self.memory else "RLIMIT_AS of each process, and their sum watched",
        )
        yield "processes", f"{group}: pids" if self.processes else "RLIMIT_NPROC"
        yield "processor time", f"{group}: its clock" if self.clock else "clocks of the processes"
        yield "wall clock, output, lines", "this process"
        yield "files of its own", f"{box}: sized tmpfs" if box else "RLIMIT_FSIZE"
        yield "ends with its worker", f"{box}: PR_SET_PDEATHSIG, pid namespace" if box else "process group"


def _user() -> str:
    if os.getuid() == 0:
        return "setpriv: a user of its own without capabilities, in a user namespace"
    return "bubblewrap: user namespace without capabilities"


@cache
def available_layers() -> Layers:
    """Return the layers that hold on this machine for this user."""
    why = _why_no_box()
    found = cgroups.trees().folders
    layers = Layers(
        seccomp=seccomp.binding() is not None,
        memory="memory" in found,
        processes="pids" in found,
        clock="cpuacct" in found,
        why=why,
    )
    return layers.without("files", "network", "pids", "ipc", "users") if why else layers


def _why_no_box() -> str:
    """Return why bubblewrap can't make a box here, "" if it can."""
    from dubins_traffic.sandbox.launch import probe

    if shutil.which("bwrap") is None:
        return "it is not installed"
    try:
        done = subprocess.run(
            probe(), stdin=subprocess.DEVNULL, capture_output=True, timeout=WAIT, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return shown(str(error), 200)
    if done.returncode == 0:
        return ""
    said = done.stderr.decode(errors="replace").strip().splitlines()
    return shown(said[-1] if said else f"status {done.returncode}", 200)


NAMES: Final = tuple(each.name for each in fields(Layers) if each.name != "why")
"""The layers, by name."""
