"""How a controller goes over the course: what it was asked, what it answered, when, and how each trial ended."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from time import monotonic, perf_counter, sleep

from dubins_traffic.campaign.course import course
from dubins_traffic.campaign.single import Result, run_trial
from dubins_traffic.cars.state import Command, Observation
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Closes, Controller

DEADLINE = 5.0
"""Seconds for one answer, after which a trial ends."""
ERRORS = 2
"""The file descriptor to which a controller's own output goes: standard output is ours."""
REHEARSAL = 0.2
"""Simulated seconds that are driven once before the course."""
PATIENCE = 60.0
"""Seconds for everything else: to load, to learn a problem, to drive the rest of a trial."""
FAREWELL = 5.0
"""Seconds in which a program that is no longer needed must end."""


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
    """The course once. `farewell` says what was wrong with the program's end, `lost` what broke the course off."""

    drives: list[Drive] = field(default_factory=list[Drive])
    farewell: str = ""
    lost: str = ""


def driven(name: str, result: Result, answers: list[float], commands: list[tuple[float, float]]) -> Drive:
    """Return what has been seen of a trial."""
    ending, begin = result.ending, result.wall.time_to_begin_s
    return Drive(name, ending.end.value, ending.detail, ending.ticks, begin, answers, commands)


class Witness:
    """Passes on to a controller and notes what it answers."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self.answers: list[float] = []
        self.commands: list[tuple[float, float]] = []

    def start(self, problem: Problem) -> None:
        """Pass on."""
        self._controller.start(problem)

    def act(self, observation: Observation) -> Command | tuple[float, float] | None:
        """Pass on and note."""
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
        out = Path(folder) / "drives"
        out.touch()
        command = [sys.executable, "-m", __spec__.name, controller, str(out)]
        environment = {**os.environ, "PYTHONHASHSEED": str(number)}
        with subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=ERRORS) as child:
            try:
                lost = _await(child, out)
            finally:
                farewell = _see_off(child)
        drives = [Drive(**json.loads(line)) for line in out.read_text(encoding="utf-8").splitlines()]
    if len(drives) < len(course()):
        return Pass(drives, lost=lost or farewell or "the process ended before the course")
    return Pass(drives, farewell)


def _await(child: subprocess.Popen[bytes], out: Path) -> str:
    """Wait until all drives are written or the child has ended; return what went wrong."""
    whole = len(course())
    done, since = 0, monotonic() + PATIENCE  # a first run compiles for long
    while child.poll() is None and done < whole:
        sleep(0.05)
        now = len(out.read_bytes().splitlines())
        if now > done:
            done, since = now, monotonic()
        if monotonic() - since > PATIENCE:
            return f"nothing more after {PATIENCE:g} s"
    return ""


def _see_off(child: subprocess.Popen[bytes]) -> str:
    """Wait for the end of a process that is no longer needed, and say what was wrong with it."""
    try:
        status = child.wait(FAREWELL)
    except subprocess.TimeoutExpired:
        child.kill()
        child.wait()
        return f"the process was still there after {FAREWELL:g} s"
    return "" if status == 0 else f"the process ended with status {status}"


def _main(controller: str, out: str) -> None:
    instances = course()
    rehearsal = replace(next(iter(instances.values())), duration=REHEARSAL)
    run_trial(rehearsal, controllers.load(controller))  # what is compiled on a first run is not measured
    with Path(out).open("a", encoding="utf-8") as file:
        for name, instance in instances.items():
            witness = Witness(controllers.load(controller))
            result = run_trial(instance, witness, deadline=DEADLINE)
            drive = driven(name, result, witness.answers, witness.commands)
            file.write(json.dumps(asdict(drive)) + "\n")
            file.flush()


if __name__ == "__main__":
    _main(*sys.argv[1:])
