"""One pass of a controller over the course: observations, answers and their times, and the end of each trial."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter, sleep

from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.checkup.watch import Place, Waited, ended, see_off
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Closes, Controller
from dubins_traffic.runs.single import Result, run_trial

DEADLINE = 5.0
"""Seconds for one answer, after which the trial ends."""
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
    """One pass over the course; `farewell`: what was wrong with the program's end, `lost`: what broke it off."""

    drives: list[Drive] = field(default_factory=list[Drive])
    farewell: str = ""
    lost: str = ""


def driven(name: str, result: Result, answers: list[float], commands: list[tuple[float, float]]) -> Drive:
    """Return what was observed in a trial."""
    ending, begin = result.ending, result.wall.time_to_begin_s
    return Drive(name, ending.end.value, ending.detail, ending.ticks, begin, answers, commands)


class Witness:
    """Wraps a controller and notes its answers.

    Parameters
    ----------
    controller : Controller
        Who is asked.
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
    """Run the course in a process of its own, with hashes of strings that differ from pass to pass.

    Parameters
    ----------
    controller : str
        As for `run_trial`.
    number : int
        Of the pass.
    """
    with TemporaryDirectory() as folder:
        out, place = Path(folder) / "drives", Path(folder) / "place"
        out.touch()
        with Place.made(place) as reached:
            command = [sys.executable, "-m", __spec__.name, controller, str(out), str(place)]
            environment = {**os.environ, "PYTHONHASHSEED": str(number)}
            with subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=ERRORS) as child:
                try:
                    lost = _await(child, out, reached)
                finally:
                    farewell = see_off(child.pid, child.poll)
                    if farewell:
                        child.kill()
                    status = child.wait()
            drives = [Drive(**json.loads(line)) for line in out.read_text(encoding="utf-8").splitlines()]
            if len(drives) == len(scenarios()):
                return Pass(drives, farewell or ("" if status == 0 else f"the process {ended(status)}"))
            lost = lost or f"the process {ended(status)}"
            died = None if reached.trial != len(drives) else _died(reached, lost)
    return Pass([*drives, died] if died is not None else drives, lost=lost)


def _died(reached: Place, lost: str) -> Drive:
    """Return the trial in which the process died."""
    name, tick = list(scenarios())[reached.trial], reached.tick
    where = "before its first answer" if tick < 0 else f"at tick {tick}"
    begin = reached.begin if tick >= 0 else None
    return Drive(name, DIED, f"{where}: {lost}", max(0, tick), begin, [], [])


def _await(child: subprocess.Popen[bytes], out: Path, reached: Place) -> str:
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
        if waited.seconds() > (PATIENCE if seen[1] >= 0 else COMPILING):
            child.kill()
            return f"was ended: nothing more after {PATIENCE:g} s"
    return ""


def _main(controller: str, out: str, place: str) -> None:
    instances = scenarios()
    rehearsal = replace(next(iter(instances.values())), duration=REHEARSAL)
    run_trial(rehearsal, controllers.load(controller))  # what is compiled on a first run is not measured
    with Place.opened(Path(place)) as reached, Path(out).open("a", encoding="utf-8") as file:
        for number, (name, instance) in enumerate(instances.items()):
            reached.put(number, math.nan, -1)
            witness = Witness(controllers.load(controller), partial(reached.put, number))
            result = run_trial(instance, witness, deadline=DEADLINE)
            drive = driven(name, result, witness.answers, witness.commands)
            file.write(json.dumps(asdict(drive)) + "\n")
            file.flush()


if __name__ == "__main__":
    _main(*sys.argv[1:])
