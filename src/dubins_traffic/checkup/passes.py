"""One pass of a controller over the course: observations, answers and their times, and the end of each trial."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.checkup.watch import SharedProgress, Waited, ended, see_off
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Closes, Controller, End
from dubins_traffic.runs.processes import deaf_to_interrupts
from dubins_traffic.runs.single import Result, run_trial

DEADLINE = 5.0
"""Seconds for one answer, after which the trial ends."""
FIRST = 30.0
"""Seconds for one answer in the rehearsal, in which controllers compile; after a later one there is no course."""
ERRORS = 2
"""The file descriptor to which a controller's own output goes; standard output is reserved for the results."""
REHEARSAL = 0.2
"""Simulated seconds that are driven once before the course."""
PATIENCE = 60.0
"""Seconds for everything else: to load, to start, to drive the rest of a trial."""
COMPILING = 3600.0
"""Seconds to load and to compile all kernels on a first run."""
DIED = "died"
"""The end of a trial in which its process ended."""


@dataclass(frozen=True, slots=True)
class Drive:
    """One trial of the course.

    `begin_s` is the time to begin, None if it never began; `answers_s` the latency of every answer and `commands` the
    speeds and yaw rates as they were asked for, before they were clipped.
    """

    name: str
    end: str
    detail: str
    ticks: int
    begin_s: float | None
    answers_s: list[float]
    commands: list[tuple[float, float]]


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass over the course.

    `farewell` is what was wrong with the program's end, `lost` what broke it off, `hung` whether that was for want of
    an answer.
    """

    drives: list[Drive] = field(default_factory=list[Drive])
    farewell: str = ""
    lost: str = ""
    hung: bool = False


def driven(name: str, result: Result, answers: list[float], commands: list[tuple[float, float]]) -> Drive:
    """Return what was observed in a trial."""
    ending, begin = result.ending, result.wall.time_to_begin_s
    return Drive(name, ending.end.value, ending.detail, ending.ticks, begin, answers, commands)


class Witness:
    """Wraps a controller and notes its answers.

    Parameters
    ----------
    mark : callable
        Is told the time to begin (seconds) once the controller has started, and the tick before each answer.
    """

    def __init__(self, controller: Controller, mark: Callable[[float, int], None]) -> None:
        self._controller, self._mark = controller, mark
        self.answers: list[float] = []
        self.commands: list[tuple[float, float]] = []

    def start(self, problem: Problem) -> None:
        """Pass on."""
        began = perf_counter()
        self._controller.start(problem)
        self._begin = perf_counter() - began

    def act(self, observation: Observation) -> Command | tuple[float, float] | None:
        """Return the controller's answer, and note it."""
        self._mark(self._begin, observation.tick)
        began = perf_counter()
        command = self._controller.act(observation)
        self.answers.append(perf_counter() - began)
        if isinstance(command, tuple):
            self.commands.append((float(command[0]), float(command[1])))
        return command

    def close(self) -> None:
        """Pass on."""
        if isinstance(self._controller, Closes):
            self._controller.close()


def run_here(controller: str, number: int) -> Pass:
    """Run the course in a process of its own, with hashes of strings that differ from pass to pass."""
    with TemporaryDirectory() as folder:
        out, place = Path(folder) / "drives", Path(folder) / "place"
        out.touch()
        with SharedProgress.made(place) as reached:
            with _begun(controller, number, out, place) as child:
                try:
                    lost = _await(child, out, reached)
                except BaseException:
                    child.kill()
                    raise
                farewell = see_off(child.pid, child.poll)
                if farewell:
                    child.kill()
                status = child.wait()
            drives = [Drive(**json.loads(line)) for line in out.read_text(encoding="utf-8").splitlines()]
            if len(drives) == len(scenarios()):
                return Pass(drives, farewell or ("" if status == 0 else f"the process {ended(status)}"))
            late = reached.trial < 0 and bool(drives)
            hung = late or bool(lost)
            lost = lost or f"the process {ended(status)}"
            died = None if max(0, reached.trial) != len(drives) else _died(reached, lost)
    return Pass([*drives, died] if died is not None else drives, lost=lost, hung=hung)


@contextmanager
def _begun(controller: str, number: int, out: Path, place: Path) -> Generator[subprocess.Popen[bytes]]:
    """Begin the process of a pass: it is deaf to Ctrl-C, which is for its parent, and ends with its parent."""
    environment = {**os.environ, "PYTHONHASHSEED": str(number)}
    watched, held = os.pipe()
    try:
        command = [sys.executable, "-m", __spec__.name, controller, str(out), str(place), str(watched)]
        with deaf_to_interrupts():
            child = subprocess.Popen(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=ERRORS, pass_fds=(watched,)
            )
        with child:
            yield child
    finally:
        os.close(watched)
        os.close(held)


def _died(reached: SharedProgress, lost: str) -> Drive:
    """Return the trial in which the process died."""
    begin = None if math.isnan(reached.begin) else reached.begin
    name, tick = list(scenarios())[max(0, reached.trial)], -1 if begin is None else reached.tick
    where = "before its first answer" if tick < 0 else f"at tick {tick}"
    return Drive(name, DIED, f"{where}: {lost}", max(0, tick), begin, [], [])


def _await(child: subprocess.Popen[bytes], out: Path, reached: SharedProgress) -> str:
    """Wait until all drives are written or the child has ended; return what went wrong.

    As long as trials go on, nobody is hurried; before the first, the kernels are compiled.
    """
    whole = len(scenarios())
    waited, seen = Waited(child.pid), (0, -1, -1)
    while child.poll() is None and seen[0] < whole:
        sleep(0.05)
        now = (len(out.read_bytes().splitlines()), reached.trial, reached.tick)
        if now != seen:
            waited, seen = Waited(child.pid), now
        if waited.seconds() > (PATIENCE if seen[1:] != (-1, -1) else COMPILING):
            child.kill()
            return f"was ended: nothing more after {PATIENCE:g} s"
    return ""


def _main(controller: str, out: str, place: str, parent: str) -> None:
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGTERM})
    threading.Thread(target=_end_with_parent, args=(int(parent),), daemon=True).start()
    instances = scenarios()
    with SharedProgress.opened(Path(place)) as reached, Path(out).open("a", encoding="utf-8") as file:
        late = _rehearse(controller, reached)
        if late is not None:
            file.write(json.dumps(asdict(late)) + "\n")
            return
        for number, (name, instance) in enumerate(instances.items()):
            reached.put(number, math.nan, -1)
            witness = Witness(controllers.load(controller), partial(reached.put, number))
            result = run_trial(instance, witness, deadline=DEADLINE)
            drive = driven(name, result, witness.answers, witness.commands)
            file.write(json.dumps(asdict(drive)) + "\n")
            file.flush()


def _rehearse(controller: str, reached: SharedProgress) -> Drive | None:
    """Drive a moment, so that what is compiled on a first run is not measured; return it if an answer never came.

    Built-in controllers take as long as they need, since compiling them may; all others have `FIRST` for an answer.
    """
    name, instance = next(iter(scenarios().items()))
    rehearsal = replace(instance, duration=REHEARSAL)
    shield = controllers.shield_of(controller)
    if (controller if shield is None else shield[0]) in controllers.names():
        run_trial(rehearsal, controllers.load(controller))
        return None
    run_trial(rehearsal, controllers.load("simple"))
    reached.put(-1, math.nan, 0)
    witness = Witness(controllers.load(controller), partial(reached.put, -1))
    result = run_trial(rehearsal, witness, deadline=FIRST)
    late = result.ending.end == End.DEADLINE
    return driven(name, result, witness.answers, witness.commands) if late else None


def _end_with_parent(held: int) -> None:
    """Wait until the parent, which holds the other end of a pipe, has ended, and end at once."""
    os.read(held, 1)
    os._exit(1)


if __name__ == "__main__":
    _main(*sys.argv[1:])
