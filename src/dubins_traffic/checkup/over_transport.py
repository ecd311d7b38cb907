"""The course over a transport: the controller is a program that is started for each pass."""

from __future__ import annotations

import os
import shlex
import shutil
import signal
import subprocess
from collections.abc import Generator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from threading import Event, Thread

from dubins_traffic.checkup.passes import DEADLINE, ERRORS, PATIENCE, Drive, Pass, driven
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.checkup.watch import Waited, ended, see_off
from dubins_traffic.errors import InputError, TransportError
from dubins_traffic.protocols import End, Transport
from dubins_traffic.sessions.plan import rehearse
from dubins_traffic.sessions.remote import Session, run_remote
from dubins_traffic.sessions.ros2 import make_transport
from dubins_traffic.transports.clocks import Lockstep, Patience
from dubins_traffic.transports.inbox import Inbox
from dubins_traffic.transports.link import EGO_NAME, Link
from dubins_traffic.transports.maestro import Maestro


@dataclass(frozen=True, slots=True)
class Meeting:
    """A transport, and the environment variables by which a program finds it."""

    transport: Transport
    environment: Mapping[str, str]


class NotingLink(Link):
    """Notes the answers of the ego's driver."""

    commands: list[tuple[float, float]]

    def announce(self) -> None:
        """Begin new notes."""
        self.commands = []
        super().announce()

    def command(self, car: str, tick: int) -> tuple[float, float]:
        """Note the command."""
        command = super().command(car, tick)
        self.commands.append(command)
        return command

    @property
    def answers(self) -> list[float]:
        """Time to the answer of each frame of the trial, seconds."""
        return list(self._punctuality.answers[EGO_NAME])


def run_over(over: str, command: str) -> tuple[Pass, Pass]:
    """Run the course twice in lockstep with a program that drives over a transport, started afresh each time.

    What trials need is compiled before: the program's time is not spent with that.

    Parameters
    ----------
    over : str
        ``lcm``, ``ros1`` or ``ros2``.
    command : str
        Starts the program, which is told where to go by the variables of its middleware.

    Raises
    ------
    InputError
        If there is no such program.
    TransportError
        If the transport can't be opened.
    """
    words = _words(command)
    rehearse(next(iter(scenarios().values())))
    maestro = Maestro()
    with _MEETINGS[over](maestro) as meeting:
        patience = Patience(begin=PATIENCE / 3)
        link = NotingLink(meeting.transport, Lockstep(DEADLINE), patience=patience)
        first, second = (_run(link, maestro, words, meeting.environment) for _ in range(2))
    return first, second


def _run(link: NotingLink, maestro: Maestro, words: Sequence[str], environment: Mapping[str, str]) -> Pass:
    instances = scenarios()
    names, drives, lost = list(instances), list[Drive](), ""
    program = _start(words, environment)
    watch = _Watch(program, link.inbox)
    try:
        session = Session(link, list(instances.values()).__getitem__, len(names), maestro)
        for result in run_remote(session):
            drives.append(driven(names[len(drives)], result, link.answers, link.commands))
            watch.proceed()
    except TransportError as error:
        lost = str(error)
    finally:
        watch.end()
        farewell = _dismiss(program)
    return Pass(drives, farewell, lost)


class _Watch:
    """Ends the course if the program has ended, or has asked for no trial for too long."""

    def __init__(self, program: subprocess.Popen[bytes], inbox: Inbox) -> None:
        self._program, self._inbox = program, inbox
        self._over = Event()
        self.proceed()
        self._thread = Thread(target=self._look, name="watch", daemon=True)
        self._thread.start()

    def proceed(self) -> None:
        """Begin the program's time anew, since a trial has ended."""
        self._waited = Waited(self._program.pid, os.getpid())

    def end(self) -> None:
        """Stop watching."""
        self._over.set()
        self._thread.join()

    def _look(self) -> None:
        while not self._over.wait(0.1):
            if self._program.poll() is not None:
                self._inbox.stop(End.PEER_LOST, f"the program {ended(self._program.returncode)}")
            elif self._waited.seconds() > PATIENCE:
                self._inbox.stop(End.PEER_SILENT, f"no trial began or ended within {PATIENCE:g} s")


def _words(command: str) -> list[str]:
    try:
        words = shlex.split(command)
    except ValueError as error:
        raise _no_program(str(error), command) from error
    if not words or shutil.which(words[0]) is None:
        raise _no_program("no such program", command)
    return words


def _no_program(why: str, command: str) -> InputError:
    return InputError(f"can't be started: {why}", file="C", value=command, expected="a command line")


def _start(words: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[bytes]:
    try:
        return subprocess.Popen(
            words,
            env={**os.environ, **environment},
            stdin=subprocess.DEVNULL,
            stdout=ERRORS,
            start_new_session=True,
            preexec_fn=_hear,  # noqa: PLW1509  # it takes no lock that a thread may hold
        )
    except OSError as error:
        raise _no_program(str(error), shlex.join(words)) from error


def _hear() -> None:
    """Let the program hear Ctrl-C, by which it is to end, also where this one ignores it, as behind nohup."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _dismiss(program: subprocess.Popen[bytes]) -> str:
    """End the program as Ctrl-C does, and return what was wrong with its end."""
    early = program.poll()
    if early is not None:
        return f"the program {ended(early)} before it was told to"
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        os.killpg(program.pid, number)
        if see_off(program.pid, program.poll):
            continue
        return "" if number == signal.SIGINT else f"the program took {number.name} to end"
    return "the program could not be ended"


@contextmanager
def _over_lcm(maestro: Maestro) -> Generator[Meeting]:
    from dubins_traffic.transports.lcm.connection import url_of_its_own
    from dubins_traffic.transports.lcm.transport import Lcm

    with url_of_its_own() as url:
        transport = Lcm(url, maestro)
        try:
            yield Meeting(transport, {"LCM_DEFAULT_URL": url})
        finally:
            transport.close()


@contextmanager
def _over_ros1(maestro: Maestro) -> Generator[Meeting]:
    from dubins_traffic.transports.ros1.master import Master
    from dubins_traffic.transports.ros1.node import leave
    from dubins_traffic.transports.ros1.transport import Ros1

    with ExitStack() as stack:
        master = Master(0)
        stack.callback(master.close)
        os.environ["ROS_IP"] = "127.0.0.1"
        stack.callback(leave)
        transport = Ros1(master.uri, maestro=maestro)
        stack.callback(transport.close)
        yield Meeting(transport, {"ROS_MASTER_URI": master.uri, "ROS_IP": "127.0.0.1"})


@contextmanager
def _over_ros2(maestro: Maestro) -> Generator[Meeting]:
    domain = 100 + os.getpid() % 100
    transport = make_transport(domain, maestro)
    try:
        yield Meeting(transport, {"ROS_DOMAIN_ID": str(domain), "ROS_LOCALHOST_ONLY": "1"})
    finally:
        transport.close()


_MEETINGS = {"lcm": _over_lcm, "ros1": _over_ros1, "ros2": _over_ros2}
