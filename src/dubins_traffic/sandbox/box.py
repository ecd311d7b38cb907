"""A program in a box: begun, asked in lockstep by lines, watched by its clocks, and ended with a name."""

from __future__ import annotations

import contextlib
import os
import select
import signal
import subprocess
from collections.abc import Generator
from threading import Lock
from time import monotonic
from typing import Final

from dubins_traffic.errors import PeerError, shown
from dubins_traffic.protocols import End
from dubins_traffic.sandbox import cgroups, seccomp
from dubins_traffic.sandbox.clocks import ProcessClocks
from dubins_traffic.sandbox.launch import STANDS, Program, command_line
from dubins_traffic.sandbox.layers import Layers
from dubins_traffic.sandbox.limits import BoxEnd, Limits, owner_of

LOOK: Final = 0.02
"""Seconds between two looks at the clocks while an answer is waited for."""
LONGEST: Final = 1 << 16
"""Bytes of a line above which it is no message."""
TAIL: Final = 8192
"""Bytes of what a program has printed that are kept."""
SLACK: Final = 5.0
"""So many times its processor time an answer may take before the rest counts as sleep."""
GRACE: Final = 10.0
"""Seconds within which a program that has ended, or been killed, is gone."""
_STANDS: Final = f"{STANDS}\n".encode()


class BoxOverError(PeerError):
    """The driving of a controller in a box is over; `end` says how."""

    def __init__(self, end: BoxEnd) -> None:
        super().__init__(end.name, end.detail)
        self.end = end


class Box:
    """A program in a box, for one trial. It is begun at once and ends with `close`, or when this process does.

    Parameters
    ----------
    program : Program
        What runs in it.
    limits : Limits
        What it may use.
    layers : Layers
        Which layers it has.

    Raises
    ------
    BoxOverError
        If it can't be begun: the platform's fault.
    """

    def __init__(self, program: Program, limits: Limits, layers: Layers) -> None:
        self._limits, self._layers = limits, layers
        self.bank = limits.bank_seconds
        """Seconds of processor time that are left in the bank."""
        self._allowed = limits.start_seconds
        self._spent = 0.0
        self._began = self._waited = 0.0
        self._said = bytearray()
        self._log = bytearray()
        self._printed = 0
        self._stands = False
        self._prints = True
        self._over: BoxEnd | None = None
        self._group: cgroups.Group | None = None
        try:
            self._begin(program)
        except OSError as error:
            self.close()
            raise self._end(End.BOX_FAILED, f"the box could not be begun: {error}") from error

    def _begin(self, program: Program) -> None:
        where = _groups(self._layers)
        if where:
            self._group = cgroups.Group(where, self._limits)
        timed = self._layers.clock and self._group is not None and self._group.has_clock
        rules = seccomp.program(counts_children=not timed) if self._layers.seccomp else b""
        with _piped(rules) as source:
            line = command_line(
                program,
                self._limits,
                self._layers,
                doors=() if self._group is None else self._group.doors,
                seccomp=source,
            )
            self._process = _begun(line, source, program, self._layers)
        self._streams = [self._process.stdin, self._process.stdout, self._process.stderr]
        self._in, self._out, self._err = (stream.fileno() for stream in self._streams if stream is not None)
        for each in (self._in, self._out, self._err):
            os.set_blocking(each, False)
        self._poll = select.poll()
        self._poll.register(self._out, select.POLLIN)
        self._poll.register(self._err, select.POLLIN)
        self._clocks = ProcessClocks(self._process.pid)
        self._group_clock = self._group.seconds if timed and self._group is not None else None

    def ask(self, message: bytes, *, answered: bool = True) -> bytes:
        """Send a line and return the one that answers it, without its end.

        Parameters
        ----------
        message : bytes
            Whole lines.
        answered : bool
            Whether an answer is waited for; if not, b"" is returned when all has been sent.

        Raises
        ------
        BoxOverError
            If the program is over, or uses more than it may.
        """
        if self._over is not None:
            raise BoxOverError(self._over)
        unsent = memoryview(message)
        self._began = monotonic()
        while True:
            unsent = self._send(unsent)
            if not unsent and not answered:
                self._account()
                return b""
            if self._wait(writing=bool(unsent)):
                line = self._line()
                if line is not None:
                    self._account()
                    return line
            self._watch()

    def decide(self) -> None:
        """From here on the processor time of a decision counts, not that of the start."""
        self._allowed = self._limits.decision_seconds

    @property
    def log_tail(self) -> str:
        """The last that the program printed, as text that is safe to show."""
        lines = self._log[-TAIL:].decode(errors="replace").splitlines()
        return "\n".join(shown(line) for line in lines)

    @property
    def over(self) -> BoxEnd | None:
        """How it ended, None while it has not."""
        return self._over

    def seconds(self) -> float:
        """Return the processor time that the box has used so far."""
        return self._group_clock() if self._group_clock is not None else self._clocks.seconds(now=True)

    def close(self) -> None:
        """End the program and all that it has begun, and leave nothing behind. May be called twice."""
        process = getattr(self, "_process", None)
        if process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                if self._layers.boxes:
                    process.kill()
                else:
                    os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            for stream in filter(None, self._streams):
                stream.close()
        if self._group is not None:
            self._group.close()
            self._group = None

    def fault(self, end: End, detail: str) -> BoxOverError:
        """Return the error that ends the driving for a reason that whoever reads the answers has found."""
        return self._end(end, detail)

    def _send(self, unsent: memoryview) -> memoryview:
        if not unsent:
            return unsent
        try:
            return unsent[os.write(self._in, unsent) :]
        except BlockingIOError:
            return unsent
        except OSError:
            return unsent[
                len(unsent) :
            ]  # it reads no more: what it says at last, and that it is gone, is read

    def _wait(self, *, writing: bool) -> bool:
        """Wait a little for something to read; return whether there is something of an answer."""
        if writing:
            self._poll.register(self._in, select.POLLOUT)
        try:
            found = self._poll.poll(LOOK * 1000.0)
        finally:
            if writing:
                self._poll.unregister(self._in)
        answer = False
        for descriptor, _ in found:
            if descriptor == self._err:
                self._print()
            elif descriptor == self._out:
                answer = True
        return answer

    def _line(self) -> bytes | None:
        """Return a whole line if there is one."""
        try:
            data = os.read(self._out, LONGEST)
        except BlockingIOError:
            return None
        if not data:
            raise self._gone()
        self._said += data
        line, found, rest = self._said.partition(b"\n")
        if len(line) > LONGEST:
            raise self._end(End.PEER_GARBAGE, f"a line longer than {LONGEST} bytes")
        if not found:
            return None
        if rest:
            raise self._end(End.PEER_FLOOD, "it said more than it was asked")
        self._said.clear()
        return bytes(line)

    def _print(self) -> None:
        """Take what has been printed."""
        try:
            data = os.read(self._err, LONGEST)
        except BlockingIOError:
            return
        if not data:
            if self._prints:
                self._poll.unregister(self._err)
            self._prints = False
            return
        self._log += data
        if not self._stands:
            before, found, rest = self._log.partition(_STANDS)
            self._stands = bool(found)
            self._log = bytearray(rest if found else before)
            data = bytes(rest) if found else b""
        self._printed += len(data)
        del self._log[:-TAIL]
        if self._printed > self._limits.output and self._layers.judge:
            raise self._end(End.OUTPUT_FLOOD, f"it printed more than {self._limits.output} bytes")

    def _account(self) -> None:
        """Book an answer: what it took beyond a decision's time is taken from the bank."""
        spent = self._group_clock() if self._group_clock is not None else self._clocks.seconds()
        self._waited += monotonic() - self._began
        used = spent - self._spent
        self._spent = max(self._spent, spent)
        if used > self._allowed:
            self._draw(used)

    def _draw(self, used: float) -> None:
        self.bank -= used - self._allowed
        if self.bank < 0.0:
            raise self._out_of_time()

    def _watch(self) -> None:
        """End what uses more than it may while an answer is waited for."""
        if not self._layers.judge:
            return
        spent = self.seconds()
        if spent - self._spent > self._allowed + self.bank:
            raise self._out_of_time()
        waited = self._waited + monotonic() - self._began
        if waited - SLACK * spent > self._limits.wall_seconds:
            detail = (
                f"no answer for want of trying: {waited:.0f} s waited for {spent:.1f} s of processor time"
            )
            raise self._end(End.PEER_SILENT, detail)
        if self._group_clock is None and self._clocks.memory > self._limits.memory:
            raise self._out_of_memory()

    def _out_of_time(self) -> BoxOverError:
        limits = self._limits
        what = (
            f"{limits.decision_seconds:g} s a decision"
            if self._allowed == limits.decision_seconds
            else f"{limits.start_seconds:g} s to start"
        )
        return self._end(
            End.OUT_OF_TIME,
            f"more processor time than {what} and {limits.bank_seconds:g} s of a trial's bank",
        )

    def _out_of_memory(self) -> BoxOverError:
        return self._end(End.OUT_OF_MEMORY, f"more memory than {self._limits.memory} bytes")

    def _gone(self) -> BoxOverError:
        """Return the error that names how the program ended by itself."""
        try:
            status = self._process.wait(GRACE)
        except subprocess.TimeoutExpired:
            return self._end(End.PEER_LOST, "it closed its output")
        with contextlib.suppress(BoxOverError):
            while self._prints and any(each == self._err for each, _ in self._poll.poll(0.0)):
                self._print()
        if self._group is not None and self._group.out_of_memory():
            return self._out_of_memory()
        last = self.log_tail.splitlines()[-1:] or [""]
        if not self._stands:
            return self._end(End.BOX_FAILED, f"the box could not be made: {shown(last[0], 200)}")
        words = f"its program ended with {_status_text(status)}"
        return self._end(End.PEER_LOST, words + (f": {shown(last[0], 200)}" if last[0] else ""))

    def _end(self, end: End, detail: str) -> BoxOverError:
        if self._over is None:
            self._over = BoxEnd(end.value, owner_of(end), detail, self.log_tail)
        return BoxOverError(self._over)


def _status_text(status: int) -> str:
    number = -status if status < 0 else status - 128
    try:
        return f"signal {signal.Signals(number).name}" if number > 0 else f"status {status}"
    except ValueError:
        return f"status {status}"


def _groups(layers: Layers) -> cgroups.Trees:
    """Return where a box's groups are, of the controllers that are wanted."""
    where = cgroups.trees()
    wanted = {"memory": layers.memory, "pids": layers.processes, "cpuacct": layers.clock}
    return cgroups.Trees(where.version, {name: each for name, each in where.folders.items() if wanted[name]})


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


_forking: Final = Lock()


def _begun(line: list[str], source: int, program: Program, layers: Layers) -> subprocess.Popen[bytes]:
    environment = {"PATH": os.environ.get("PATH", os.defpath)}
    if not layers.environment:
        environment = dict(os.environ)
    if not layers.boxes:
        environment |= {"HOME": "/tmp", "LANG": "C.UTF-8", **program.environment}
    with _forking:
        return subprocess.Popen(
            line,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            pass_fds=() if source < 0 else (source,),
            env=environment,
            cwd="/",
            start_new_session=True,
            bufsize=0,
        )
