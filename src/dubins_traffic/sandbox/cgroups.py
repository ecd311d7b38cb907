"""Control groups: the kernel's own limits on memory and processes of a box, and its clock of their processor time.

Version 1 has a tree for each controller, version 2 one for all. A box has a group of its own in each tree, below that
of this process where it may write, else beside it. `trees` returns where groups can be made, if anywhere.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from itertools import count
from pathlib import Path
from time import monotonic, sleep
from typing import Final

from dubins_traffic.sandbox.limits import Limits

NAME: Final = "dubins-traffic-box"
TREES: Final = ("memory", "pids", "cpuacct")
PATIENCE: Final = 5.0
"""Seconds within which the last process of a group that has been killed is gone."""
_numbers = count()


@dataclass(frozen=True, slots=True)
class Trees:
    """Where groups can be made: folders by controller. `version` is 1 or 2; of version 2 all folders are one."""

    version: int
    folders: Mapping[str, Path] = field(default_factory=dict[str, Path])

    def __bool__(self) -> bool:
        return bool(self.folders)


@cache
def trees() -> Trees:
    """Return where this process can make groups, and sweep what those have left who were killed."""
    first = _first_version()
    second = _second_version()
    best = second if len(second.folders) > len(first.folders) else first
    for folder in set(best.folders.values()):
        _sweep(folder)
    return best


class Group:
    """The control group of one box; OSError if it can't be made after all."""

    def __init__(self, where: Trees, limits: Limits) -> None:
        name = f"{NAME}-{os.getpid()}-{next(_numbers)}"
        self.version = where.version
        self.folders = {controller: folder / name for controller, folder in where.folders.items()}
        for folder in set(self.folders.values()):
            folder.mkdir()
        self._clock: int | None = None
        try:
            self._limit(limits)
            if "cpuacct" in self.folders:
                clock = "cpuacct.usage" if self.version == 1 else "cpu.stat"
                self._clock = os.open(self.folders["cpuacct"] / clock, os.O_RDONLY)
        except OSError:
            self.close()
            raise

    @property
    def doors(self) -> list[str]:
        """The files into which a process writes its number to be in the group."""
        return sorted({str(folder / "cgroup.procs") for folder in self.folders.values()})

    @property
    def has_clock(self) -> bool:
        """Whether it counts processor time."""
        return self._clock is not None

    def seconds(self) -> float:
        """Return the processor time of all that have ever been in the group."""
        assert self._clock is not None
        data = os.pread(self._clock, 256, 0)
        if self.version == 1:
            return int(data) * 1e-9
        return int(data.split(maxsplit=2)[1]) * 1e-6

    def out_of_memory(self) -> bool:
        """Tell whether a process has been killed since the group had no memory left."""
        if "memory" not in self.folders:
            return False
        name = "memory.oom_control" if self.version == 1 else "memory.events"
        return _value(self.folders["memory"] / name, "oom_kill") > 0

    def processes(self) -> list[int]:
        """Return the numbers of the processes in it."""
        folder = next(iter(self.folders.values()))
        return [int(line) for line in (folder / "cgroup.procs").read_text().split()]

    def close(self) -> None:
        """Kill what is in the group and remove it; what can't be removed in time is swept by the next process."""
        if self._clock is not None:
            os.close(self._clock)
            self._clock = None
        until = monotonic() + PATIENCE
        for folder in set(self.folders.values()):
            _remove(folder, until)
        self.folders = {}

    def _limit(self, limits: Limits) -> None:
        first = self.version == 1
        if "memory" in self.folders:
            _put(self.folders["memory"] / ("memory.limit_in_bytes" if first else "memory.max"), limits.memory)
            with contextlib.suppress(OSError):  # a kernel that does not count what is swapped out
                swap = "memory.memsw.limit_in_bytes" if first else "memory.swap.max"
                _put(self.folders["memory"] / swap, limits.memory if first else 0)
        if "pids" in self.folders:
            _put(self.folders["pids"] / "pids.max", limits.processes + OWN)


OWN: Final = 4
"""Processes of a group that are ours: shells and bubblewrap's own."""


def _first_version() -> Trees:
    folders: dict[str, Path] = {}
    for line in _lines("/proc/self/cgroup"):
        number, names, path = line.split(":", 2)
        if number == "0":
            continue
        for name in names.split(","):
            root = Path("/sys/fs/cgroup") / name
            inside = root / path.lstrip("/")
            base = inside if inside.is_dir() else root
            if name in TREES and _can_make(base):
                folders[name] = base
    return Trees(1, folders)


def _second_version() -> Trees:
    root = Path("/sys/fs/cgroup")
    path = next((line.split(":", 2)[2] for line in _lines("/proc/self/cgroup") if line.startswith("0:")), None)
    if path is None or not (root / "cgroup.controllers").is_file():
        return Trees(2)
    here = root / path.lstrip("/")
    for folder in (here, here.parent):
        if root not in (folder, *folder.parents) or not _can_make(folder):
            continue
        handed = set((folder / "cgroup.subtree_control").read_text().split())
        if {"memory", "pids"} <= handed or _hand_down(folder):
            return Trees(2, dict.fromkeys(TREES, folder))
    return Trees(2)


def _hand_down(folder: Path) -> bool:
    """Let groups below `folder` limit memory and processes; False where the kernel forbids it."""
    try:
        _put(folder / "cgroup.subtree_control", "+memory +pids")
    except OSError:
        return False
    return True


def _can_make(folder: Path) -> bool:
    probe = folder / f"{NAME}-{os.getpid()}-probe"
    try:
        probe.mkdir()
        probe.rmdir()
    except OSError:
        return False
    return True


def _sweep(folder: Path) -> None:
    """Remove the groups of processes that are no more."""
    for left in folder.glob(f"{NAME}-*"):
        owner = left.name.removeprefix(f"{NAME}-").partition("-")[0]
        if owner.isdigit() and not Path(f"/proc/{owner}").exists():
            _remove(left, monotonic() + PATIENCE)


def _remove(folder: Path, until: float) -> None:
    while True:
        try:
            folder.rmdir()
        except FileNotFoundError:
            return
        except OSError:
            _kill(folder)
            if monotonic() > until:
                return
            sleep(0.002)
        else:
            return


def _kill(folder: Path) -> None:
    with contextlib.suppress(OSError):
        for line in (folder / "cgroup.procs").read_text().split():
            with contextlib.suppress(ProcessLookupError):
                os.kill(int(line), 9)


def _put(file: Path, value: object) -> None:
    with file.open("w") as stream:
        stream.write(str(value))


def _value(file: Path, name: str) -> int:
    for line in _lines(file):
        key, _, value = line.partition(" ")
        if key == name:
            return int(value)
    return 0


def _lines(file: str | Path) -> list[str]:
    try:
        return Path(file).read_text().splitlines()
    except OSError:
        return []
