"""A program in a box: asked in lockstep by lines, watched by its clocks, and ended with a name."""

from __future__ import annotations

import os
import select
from time import monotonic
from typing import Final

from dubins_traffic.errors import PeerError, shown
from dubins_traffic.protocols import End
from dubins_traffic.sandbox.launch import STANDS, Program
from dubins_traffic.sandbox.layers import JUDGE, Layers
from dubins_traffic.sandbox.limits import BoxEnd, Limits, owner_of
from dubins_traffic.sandbox.process import Processes
from dubins_traffic.transports.line_messages import LONGEST

TAIL: Final = 8192
"""Bytes that are kept."""
_STANDS: Final = f"{STANDS}\n".encode()


class Printed:
    """What has been printed so far: `count` bytes since the box `stands`."""

    def __init__(self) -> None:
        self.count = 0
        self.stands = False
        self._kept = bytearray()

    def add(self, data: bytes) -> None:
        """Take more."""
        self._kept += data
        if not self.stands:
            _, stands, rest = self._kept.partition(_STANDS)
            if not stands:
                return
            self.stands, self._kept, data = True, bytearray(rest), bytes(rest)
        self.count += len(data)
        del self._kept[:-TAIL]

    @property
    def tail(self) -> str:
        """The last of it, as lines that are safe to show."""
        lines = self._kept[-TAIL:].decode(errors="replace").splitlines()
        return "\n".join(shown(line) for line in lines)

    @property
    def last(self) -> str:
        """The last line."""
        return shown((self.tail.splitlines() or [""])[-1], 200)


LOOK: Final = 0.02
"""Seconds between two looks at the clocks while an answer is waited for."""
SELDOM: Final = 0.1
"""Seconds between two looks at memory and files of a program that answers at once."""
SLACK: Final = 5.0
"""So many times its processor time an answer may take before the rest counts as sleep."""
FAREWELL: Final = 30.0
"""Seconds that a program is waited for that has been told that its trial is over."""
GRACE: Final = 10.0
"""Seconds within which a program that has closed its output ends."""


class BoxOverError(PeerError):
    """The driving of a controller in a box is over; `end` says how."""

    def __init__(self, end: BoxEnd) -> None:
        super().__init__(end.name, end.detail)
        self.end = end


class Box:
    """A program in a box, for one trial. It is begun at once and ends with `close`, or when this process does.

    A box ends with the thread that began it, too: the kernel kills it then.

    Attributes
    ----------
    bank : float
        Seconds of processor time that are left in the bank.
    over : BoxEnd or None
        How it ended, None while it has not.

    Raises
    ------
    BoxOverError
        If it can't be begun: the platform's fault.
    """

    def __init__(self, program: Program, limits: Limits, layers: Layers) -> None:
        self._limits, self._judges = limits, JUDGE in layers
        self.bank = limits.bank_seconds
        self.over: BoxEnd | None = None
        self._allowed, self._patience = limits.start_seconds, limits.wall_seconds
        self._spent = self._began = self._waited = self._looked = 0.0
        self._said = bytearray()
        self._printed, self._prints = Printed(), True
        try:
            self._processes = Processes(program, limits, layers)
        except OSError as error:
            raise self.fault(End.BOX_FAILED, f"the box could not be begun: {error}") from error
        self._poll = select.poll()
        self._poll.register(self._processes.answers, select.POLLIN)
        self._poll.register(self._processes.printed, select.POLLIN)

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
        if self.over is not None:
            raise BoxOverError(self.over)
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
        """From here on an answer may take the processor time of a decision, not that of the start."""
        self._allowed = self._limits.decision_seconds

    def part(self) -> None:
        """From here on an answer is waited for as long as one waits to say goodbye."""
        spent = self.seconds()
        self._patience = min(self._patience, self._waited - SLACK * spent + FAREWELL)

    def seconds(self) -> float:
        """Return the processor time that the box has used so far."""
        return self._processes.seconds(now=True)

    @property
    def log_tail(self) -> str:
        """The last that the program printed, as text that is safe to show."""
        return self._printed.tail

    def fault(self, end: End, detail: str) -> BoxOverError:
        """Return the error that ends the driving, unless it is over already."""
        if self.over is None:
            self.over = BoxEnd(end.value, owner_of(end), detail, self.log_tail)
        return BoxOverError(self.over)

    def close(self) -> None:
        """End the program and all that it has begun, and leave nothing behind. May be called twice."""
        self._processes.close()

    def _send(self, unsent: memoryview) -> memoryview:
        if not unsent:
            return unsent
        try:
            return unsent[os.write(self._processes.questions, unsent) :]
        except BlockingIOError:
            return unsent
        except OSError:
            return unsent[len(unsent) :]  # it reads no more; what it says at last, and that it has gone, is read

    def _wait(self, *, writing: bool) -> bool:
        """Wait a little for something to read; return whether there is something of an answer."""
        if writing:
            self._poll.register(self._processes.questions, select.POLLOUT)
        ready = self._poll.poll(LOOK * 1000.0)
        if writing:
            self._poll.unregister(self._processes.questions)
        answer = False
        for descriptor, _ in ready:
            if descriptor == self._processes.answers:
                answer = True
            elif descriptor == self._processes.printed:
                self._hear()
        return answer

    def _line(self) -> bytes | None:
        """Return a whole line if there is one."""
        try:
            data = os.read(self._processes.answers, LONGEST)
        except BlockingIOError:
            return None
        if not data:
            raise self._gone()
        self._said += data
        line, has_line, rest = self._said.partition(b"\n")
        if len(line) > LONGEST:
            raise self.fault(End.PEER_GARBAGE, f"a line longer than {LONGEST} bytes")
        if not has_line:
            return None
        if rest:
            raise self.fault(End.PEER_FLOOD, "it said more than it was asked")
        self._said.clear()
        return bytes(line)

    def _hear(self) -> None:
        """Take what has been printed."""
        try:
            data = os.read(self._processes.printed, LONGEST)
        except BlockingIOError:
            return
        if not data and self._prints:
            self._poll.unregister(self._processes.printed)
            self._prints = False
        stood = self._printed.stands
        self._printed.add(data)
        if self._printed.stands and not stood:
            self._processes.note()
        if self._judges and self._printed.count > self._limits.output:
            raise self.fault(End.OUTPUT_FLOOD, f"it printed more than {self._limits.output} bytes")

    def _account(self) -> None:
        """Book an answer: what it took beyond a decision's time is taken from the bank."""
        spent = self._processes.seconds()
        self._waited += monotonic() - self._began
        used, self._spent = spent - self._spent, spent
        if monotonic() - self._looked > SELDOM:
            self._watch()
        if used > self._allowed and self._judges:
            self.bank -= used - self._allowed
            if self.bank < 0.0:
                raise self._out_of_time()

    def _watch(self) -> None:
        """End what uses more than it may: while an answer is waited for, and now and then."""
        self._looked = monotonic()
        if not self._judges:
            return
        spent = self.seconds()
        if spent - self._spent > self._allowed + self.bank:
            raise self._out_of_time()
        waited = self._waited + monotonic() - self._began
        if waited - SLACK * spent > self._patience:
            detail = f"no answer: {waited:.0f} s waited for, {spent:.1f} s of processor time used"
            raise self.fault(End.PEER_SILENT, detail)
        if self._processes.out_of_memory():
            raise self._out_of_memory()
        if self._processes.files() > self._limits.most_files:
            detail = f"more than {self._limits.most_files} files"
            raise self.fault(End.OUT_OF_MEMORY, detail)

    def _out_of_time(self) -> BoxOverError:
        limits = self._limits
        if self._allowed == limits.start_seconds:
            most = f"{limits.start_seconds:g} s to start"
        else:
            most = f"{limits.decision_seconds:g} s a decision"
        bank = f"{limits.bank_seconds:g} s of a trial's bank"
        return self.fault(End.OUT_OF_TIME, f"more processor time than {most} and {bank}")

    def _out_of_memory(self) -> BoxOverError:
        return self.fault(End.OUT_OF_MEMORY, f"more memory than {self._limits.memory} bytes")

    def _gone(self) -> BoxOverError:
        """Return the error that names how the program ended by itself."""
        status = self._processes.status(GRACE)
        if status is None:
            return self.fault(End.PEER_LOST, "it closed its output")
        while self._prints and any(each == self._processes.printed for each, _ in self._poll.poll(0.0)):
            self._hear()
        if self._processes.out_of_memory():
            return self._out_of_memory()
        last = self._printed.last
        if not self._printed.stands:
            return self.fault(End.BOX_FAILED, f"the box could not be made: {last}")
        return self.fault(End.PEER_LOST, f"its program ended with {status}" + (f": {last}" if last else ""))
