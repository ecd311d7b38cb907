"""The processes of a box: begun, counted, timed, and killed.

Their processor time is that of their control group, or by their own clocks. By these, what a process has used counts
while it is there, and afterwards with its parent, which has waited for it; what it uses between the last look and its
end is lost only if nobody waits for it, which the filter of system calls sees to (`seccomp.program`).
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
import weakref
from collections.abc import Generator, Sequence
from functools import cache
from pathlib import Path
from time import clock_gettime, monotonic
from typing import Final

from dubins_traffic.sandbox import cgroups, seccomp
from dubins_traffic.sandbox.launch import SYSTEM, Program, command_line, outside
from dubins_traffic.sandbox.layers import CLOCK, ENVIRONMENT, MEMORY, PROCESSES, SECCOMP, Layers
from dubins_traffic.sandbox.limits import Limits

LOOK: Final = 0.02
"""Seconds between two looks at all processes."""
PIPE: Final = 1 << 16
"""Bytes that a pipe holds unless it is made larger."""
_TICK: Final = 1.0 / os.sysconf("SC_CLK_TCK")
_PAGE: Final = os.sysconf("SC_PAGE_SIZE")


class ProcessClocks:
    """Counts processor time and memory of a process and all that descend from it.

    Parameters
    ----------
    first : int
        The process from which all others of the box descend.
    """

    def __init__(self, first: int) -> None:
        self._first = first
        self._looked = -1.0
        self._seconds = 0.0
        self.memory = 0
        """Bytes that the processes held in memory at the last look."""
        self.processes: Sequence[int] = ()
        """Which there were."""

    def seconds(self, *, now: bool = False) -> float:
        """Return the processor time so far, as of the last look, which is a few hundredths of a second ago at most."""
        if now or monotonic() - self._looked > LOOK:
            self._look()
        return self._seconds

    def _look(self) -> None:
        self._looked = monotonic()
        total, memory, seen = 0.0, 0, list[int]()
        waiting = [self._first]
        while waiting:
            process = waiting.pop()
            used = _stat(process)
            if used is None:
                continue
            seconds, pages = used
            total, memory = total + seconds, memory + pages * _PAGE
            seen.append(process)
            waiting += children(process)
        self._seconds = max(self._seconds, total)
        self.memory, self.processes = memory, seen

    def kernel(self) -> int:
        """Return how many bytes the kernel holds for the processes of the last look.

        These are their page tables, and the most that their pipes and sockets may hold.
        """
        kernel_objects: set[str] = set()
        unseen = 0
        for thread in (each for process in self.processes for each in _threads(process)):
            try:
                held = list((thread / "fd").iterdir())
            except PermissionError:
                unseen += _table(thread)
                continue
            except OSError:
                continue
            for each in held:
                with contextlib.suppress(OSError):
                    kernel_objects.add(str(each.readlink()))
        sockets = unseen + sum(name.startswith("socket:") for name in kernel_objects)
        pipes = sum(name.startswith("pipe:") for name in kernel_objects)
        return sockets * _socket() + pipes * PIPE + sum(map(_page_tables, self.processes))


def _stat(process: int) -> tuple[float, int] | None:
    """Return the processor time of a process and its children that are gone, and its pages in memory."""
    try:
        data = Path(f"/proc/{process}/stat").read_bytes()
    except OSError:
        return None
    parts = data.rpartition(b")")[2].split()
    user, system, gone_user, gone_system = (int(part) for part in parts[11:15])
    exact = _exact(process)
    alive = (user + system) * _TICK if exact is None else exact
    return alive + (gone_user + gone_system) * _TICK, int(parts[21])


def _exact(process: int) -> float | None:
    """Return the processor time of a process by its clock, to the nanosecond."""
    try:
        return clock_gettime((~process << 3) | 2)
    except OSError:
        return None


def _threads(process: int) -> list[Path]:
    """Return the threads of a process; each may have descriptors of its own, and the first may have ended."""
    try:
        return list(Path(f"/proc/{process}/task").iterdir())
    except OSError:
        return []


def _status(place: Path) -> dict[str, str]:
    """Return what a process or thread says of itself, by name; nothing if it has ended."""
    try:
        lines = (place / "status").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return {}
    return dict(line.split(":", 1) for line in lines if ":" in line)


def _page_tables(process: int) -> int:
    """Return how many bytes the page tables of a process take; 0 if it has ended."""
    return int(_status(Path(f"/proc/{process}")).get("VmPTE", "0").split()[0]) << 10


def _table(thread: Path) -> int:
    """Return how many descriptors a thread has room for that does not show which it holds; 0 if it has ended."""
    status = _status(thread)
    return 0 if status.get("State", "X").split()[0] in ("Z", "X") else int(status.get("FDSize", "0"))


@cache
def _socket() -> int:
    """Return how many bytes of memory a socket may hold: one message is taken while there is any room."""
    try:
        usual = int(Path("/proc/sys/net/core/wmem_default").read_text(encoding="ascii"))
    except (OSError, ValueError):
        usual = 212992
    return 2 * usual


def children(process: int) -> list[int]:
    """Return the numbers of the processes that a process has begun and that are there."""
    numbers: list[int] = []
    try:
        for thread in Path(f"/proc/{process}/task").iterdir():
            numbers += map(int, (thread / "children").read_text().split())
    except OSError:
        return numbers
    return numbers


GRACE: Final = 10.0
"""Seconds within which processes that have been killed are gone."""


class Processes:
    """The processes of a box, in their control group if there is one.

    Parameters
    ----------
    prints : bool
        Whether what is printed goes where this process prints.

    Attributes
    ----------
    questions, answers, printed : int
        Descriptors of the program's standard input, output and error; none of them blocks. `printed` is -1 if what is
        printed goes elsewhere.

    Raises
    ------
    OSError
        If they can't be begun; then nothing is left behind.
    """

    def __init__(self, program: Program, limits: Limits, layers: Layers, *, prints: bool = False) -> None:
        self._errors = None if prints else subprocess.PIPE
        self._limits, self._layers = limits, layers
        where = _groups(layers)
        self._group = cgroups.Group(where, limits) if where else None
        try:
            self._begin(program)
        except BaseException:
            if self._group is not None:
                self._group.close()
            raise
        self._streams = [self._process.stdin, self._process.stdout, self._process.stderr]
        ends = [stream.fileno() for stream in self._streams if stream is not None]
        self.questions, self.answers, self.printed = ends if len(ends) == 3 else (*ends, -1)
        for each in ends:
            os.set_blocking(each, False)
        self._forgotten = weakref.finalize(self, _shut, self._process)
        self._others: list[int] = []
        self._first = 0
        self._clocks = ProcessClocks(self._process.pid)

    def _begin(self, program: Program) -> None:
        group = self._group
        self._timed = group if CLOCK in self._layers and group is not None and group.has_clock else None
        rules = b""
        if SECCOMP in self._layers:
            rules = seccomp.program(counts_children=self._timed is None, counts_buffers=MEMORY not in self._layers)
        doors = () if group is None else group.doors
        with _piped(rules) as source:
            line = command_line(
                program,
                self._limits,
                self._layers,
                doors=doors,
                seccomp=source,
                reports_start=self._errors is not None,
            )
            self._process = subprocess.Popen(
                line,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                pass_fds=() if source < 0 else (source,),
                env=_environment(program, self._layers),
                cwd="/",
                start_new_session=True,
                bufsize=0,
            )

    def seconds(self, *, now: bool = False) -> float:
        """Return the processor time so far; by the clocks of the processes as of the last look, unless `now`."""
        if self._timed is not None:
            return self._timed.seconds()
        return self._clocks.seconds(now=now)

    def out_of_memory(self) -> bool:
        """Tell whether they have been stopped, or are to be stopped, for the memory that they use."""
        if self._group is not None and MEMORY in self._layers:
            return self._group.out_of_memory()
        self._clocks.seconds()  # looks at the processes, also where a group's clock counts their time
        return self._clocks.memory + self._clocks.kernel() + self._file_bytes() > self._limits.memory

    def _file_bytes(self) -> int:
        """Return how many bytes the box's own files take, which lie in memory; 0 where that can't be seen."""
        filesystem = self._filesystem()
        return 0 if filesystem is None else (filesystem.f_blocks - filesystem.f_bfree) * filesystem.f_frsize

    def files(self) -> int:
        """Return how many files the box has of its own, 0 where that can't be seen."""
        filesystem = self._filesystem()
        return 0 if filesystem is None else filesystem.f_files - filesystem.f_ffree

    def _filesystem(self) -> os.statvfs_result | None:
        """Return what there is where the box has its own files."""
        if not self._first:
            return None
        try:
            return os.statvfs(f"/proc/{self._first}/root/tmp")
        except OSError:
            return None

    def status(self, seconds: float) -> str | None:
        """Return how the first process ended, None if it does not within some `seconds`."""
        for first in _opened([self._process.pid]):
            ended = _ends(first, seconds)
            os.close(first)
            if not ended:
                return None
        status = self._process.wait()
        number = -status if status < 0 else status - 128
        try:
            return f"signal {signal.Signals(number).name}" if number > 0 else f"status {status}"
        except ValueError:
            return f"status {status}"

    def note(self) -> None:
        """Note the first process of the box itself, with whose end that of all others is waited for."""
        if self._layers.boxes and not self._others:
            numbers = children(self._process.pid)
            self._others, self._first = _opened(numbers), next(iter(numbers), 0)

    def _kill(self) -> None:
        """Kill the first process, and with it the box."""
        self.note()
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def close(self) -> None:
        """Kill them all and leave nothing behind. May be called twice."""
        if self._process.returncode is None:
            self._kill()
        while self._others:
            _see_off(self._others.pop())
        self._forgotten()
        if self._group is not None:
            self._group.close()
            self._group = self._timed = None


def _shut(process: subprocess.Popen[bytes]) -> None:
    """Kill a process of a box that was forgotten, if it runs yet, and close what leads to it and from it.

    Python collects a cycle of objects in any order: what a box has opened is held here until this is done.
    """
    if process.returncode is None:
        process.kill()
        process.wait()
    for stream in filter(None, (process.stdin, process.stdout, process.stderr)):
        stream.close()


def _opened(processes: Sequence[int]) -> list[int]:
    """Return descriptors of processes that are there."""
    descriptors: list[int] = []
    for process in processes:
        with contextlib.suppress(ProcessLookupError):
            descriptors.append(os.pidfd_open(process))
    return descriptors


def _see_off(process: int) -> None:
    """Kill the process of a descriptor, wait until it has gone, and close the descriptor.

    The first process of a process namespace goes last.
    """
    with contextlib.suppress(ProcessLookupError, PermissionError):
        signal.pidfd_send_signal(process, signal.SIGKILL)
    _ends(process, GRACE)
    os.close(process)


def _ends(process: int, seconds: float) -> bool:
    """Wait for the end of the process of a descriptor; return whether it came."""
    waiting = select.poll()
    waiting.register(process, select.POLLIN)
    return bool(waiting.poll(seconds * 1000.0))


def _groups(layers: Layers) -> cgroups.Trees:
    """Return where a box's groups are, of the controllers that are wanted."""
    where = cgroups.trees()
    wanted = {"memory": MEMORY in layers, "pids": PROCESSES in layers, "cpuacct": CLOCK in layers}
    return cgroups.Trees(where.version, {name: each for name, each in where.folders.items() if wanted[name]})


def _environment(program: Program, layers: Layers) -> dict[str, str]:
    path = SYSTEM if layers.boxes else os.environ.get("PATH", os.defpath)
    base = {"PATH": path} if ENVIRONMENT in layers else dict(os.environ)
    if layers.boxes:
        return base
    more = {name: outside(program, value) for name, value in program.environment.items()}
    return base | {"HOME": "/tmp", "LANG": "C.UTF-8", **more}


@contextlib.contextmanager
def _piped(data: bytes) -> Generator[int]:
    """Yield a descriptor from which `data` is read once; -1 if there is none.

    Each start has a descriptor of its own: one that has been read would have to be rewound, and two starts share it.
    """
    if not data:
        yield -1
        return
    read, write = os.pipe()
    try:
        os.write(write, data)
        os.close(write)
        yield read
    finally:
        os.close(read)
