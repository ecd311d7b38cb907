"""Gazebo against the embedded simulator, and against itself running free.

`agreement`: four manoeuvres of ten seconds, open loop. `trials`: fifty random instances of a minute with two goals or
more, one controller. `speed`: six cars, against the clock, and against a gzserver with the same world that nobody
steps, as its own tool `gz stats` measures it.
"""

from __future__ import annotations

import math
import os
import re
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter, sleep

import numpy as np

from benchmarks.table import Row
from dubins_traffic.cars.body import Car
from dubins_traffic.cars.state import EGO, Frames, Pose
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo.prefix import Installation, find
from dubins_traffic.gazebo.simulator import Gazebo
from dubins_traffic.gazebo.world import world
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Score
from dubins_traffic.simulators.embedded import Embedded

RATE = 30
TICKS = 10 * RATE
RANDOM = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"random": {"intersections": 9, "segments": 11}},
    "e-agents": [{"type": "wander", "name": "agent", "count": 3}],
    "duration": 60,
    "number_goals_bounds": [2, 4],
    "rules": True,
}
TRIALS = 50
WINDOW, WINDOWS = 20 * RATE, 8
"""Ticks of a stretch that is timed, about a fifth of a second as well, and how many; the best of each kind counts."""
CARS = 6


def manoeuvres() -> dict[str, Floats]:
    """Return the commands of each manoeuvre, (TICKS, 2): m/s and rad/s."""
    go = (np.arange(TICKS) // RATE) % 2 == 0
    return {
        "straight, 0.5 m/s": np.tile([0.5, 0.0], (TICKS, 1)),
        "arc, 0.5 m/s and 0.4 rad/s": np.tile([0.5, 0.4], (TICKS, 1)),
        "turn in place, 0.9 rad/s": np.tile([0.0, 0.9], (TICKS, 1)),
        "stop and go, 0.5 m/s every other second": np.stack([0.5 * go, np.zeros(TICKS)], axis=1),
    }


def measure() -> list[Row]:
    """Return the rows of this benchmark."""
    try:
        installation = find()
    except InputError as error:
        return [Row("Gazebo is installed", str(error), "dubins-traffic gazebo install", False)]
    return [*_agreement(), *_speed(installation), *_trials()]


def _alone(starts: Sequence[Pose]) -> Instance:
    """Return an instance with cars at `starts` on a grid; nobody but the caller drives them."""
    drawn = draw(load_config(RANDOM), 0, 0)
    problem = replace(drawn.problem, car=Car(), rate=float(RATE))
    return replace(drawn, problem=problem, starts=tuple(starts))


def _agreement() -> Iterator[Row]:
    instance = _alone([Pose(0.0, 0.0, 1.0, 0.0)])
    for name, commands in manoeuvres().items():
        poses: list[Pose] = []
        for simulator in (Embedded(), Gazebo()):
            state = simulator.reset([instance])
            for command in commands:
                simulator.step(command.reshape(1, 1, 2).copy())
            poses.append(Pose(*(float(column[0, EGO]) for column in state[:4])))
            simulator.close()
        one, two = poses
        distance = math.hypot(one.x - two.x, one.y - two.y)
        angle = math.degrees(abs(math.atan2(one.c * two.s - one.s * two.c, one.c * two.c + one.s * two.s)))
        figure = f"{1e3 * distance:.1f} mm, {angle:.2f} degrees"
        yield Row(name, figure, "<= 20 mm, <= 1 degree after 10 s", distance <= 0.02 and angle <= 1.0)


def _speed(installation: Installation) -> Iterator[Row]:
    starts = [Pose(20.0 * n, 0.0, 1.0, 0.0) for n in range(CARS)]
    commands = {
        "driving": np.array([[(0.5, 0.0), (0.5, 0.4), (-0.3, 0.2), (0.0, 0.9), (0.7, -1.5), (0.0, 3.0)]]),
        "standing": np.zeros((1, CARS, 2)),
    }
    simulator = Gazebo()
    rates: dict[str, list[float]] = {name: [] for name in (*commands, "free")}
    for _ in range(3):
        for name, command in commands.items():
            simulator.reset([_alone(starts)])
            for _ in range(WINDOWS):
                began = perf_counter()
                for _ in range(WINDOW):
                    simulator.step(command.copy())
                rates[name].append(WINDOW / RATE / (perf_counter() - began))
        simulator.close()
        rates["free"].append(_free_running(installation, starts))
    driving, standing, free = (max(rates[name]) for name in ("driving", "standing", "free"))
    yield Row(f"{CARS} cars driving", f"{driving:.0f} times real time", ">= 20", driving >= 20.0)
    figure = f"{standing:.0f} against {free:.0f} times real time = {standing / free:.2f}"
    yield Row(f"{CARS} cars standing, stepped against free", figure, ">= 0.7", standing >= 0.7 * free)


def _free_running(installation: Installation, starts: Sequence[Pose]) -> float:
    """Return how many times real time a gzserver runs that is left alone with the same world, at its best.

    Its tool tells the times every fifth of a second.
    """
    step = 1.0 / (RATE * 7)
    text = world(starts, Car().body, (), step, "none")
    text = re.sub(r"<plugin.*?</plugin>", "", text, flags=re.DOTALL)
    with tempfile.TemporaryDirectory() as folder, _server(installation, Path(folder), text) as around:
        command = [str(installation.gzserver.with_name("gz")), "stats", "-p", "-d", "4"]
        done = subprocess.run(command, env=around, capture_output=True, text=True, check=True, timeout=60)
    found = re.findall(r"([\d.]+),\s*([\d.]+), F", done.stdout)
    times = [(float(simulated), float(real)) for simulated, real in found]
    return max((late[0] - soon[0]) / (late[1] - soon[1]) for soon, late in pairwise(times))


@contextmanager
def _server(installation: Installation, folder: Path, text: str) -> Iterator[dict[str, str]]:
    """Run a plain gzserver with a world while the body runs; yield the surroundings for its tools."""
    path = folder / "free.world"
    path.write_text(text)
    around = os.environ | installation.environment()
    around |= {"HOME": str(folder), "GAZEBO_MASTER_URI": "http://127.0.0.1:23411", "GAZEBO_IP": "127.0.0.1"}
    around |= {"GAZEBO_MODEL_DATABASE_URI": "", "ALSOFT_DRIVERS": "null"}
    quiet = subprocess.DEVNULL
    server = subprocess.Popen(
        [str(installation.gzserver), "--minimal_comms", str(path)], env=around, stdout=quiet, stderr=quiet
    )
    try:
        sleep(3.0)
        yield around
    finally:
        server.kill()
        server.wait()


@dataclass
class _Lanes:
    """A sink that keeps in which lane, and at which intersection, each car is at each frame."""

    blocks: list[Frames]

    def begin(self, instance: Instance) -> None:  # noqa: ARG002
        self.blocks.clear()

    def frames(self, frames: Frames) -> None:
        self.blocks.append(frames)

    def end(self, ending: Ending) -> None:
        """Nothing is held open."""

    @property
    def places(self) -> np.ndarray:
        return np.concatenate([np.stack([block.lane, block.at], axis=-1) for block in self.blocks])


def _trials() -> Iterator[Row]:
    configuration = load_config(RANDOM)
    equal, notes = 0, list[str]()
    for trial in range(TRIALS):
        same, note = _compared(configuration, trial)
        equal += same
        if not same:
            notes.append(note)
    figure = "; ".join([f"{equal} of {TRIALS}", *notes])
    yield Row("equal verdicts, rounds to within 1", figure, ">= 45 of 50", equal >= 45)


def _compared(configuration: Configuration, trial: int) -> tuple[bool, str]:
    instance = draw(configuration, 0, trial)
    scores: list[Score] = []
    lanes: list[np.ndarray] = []
    for name in ("embedded", "gazebo"):
        sink = _Lanes([])
        scores.append(run_trial(replace(instance, simulator=name), sinks=[sink]).score)
        lanes.append(sink.places)
    rulings = [None if score.verdict is None else score.verdict.verdict.value for score in scores]
    rounds = [score.rounds for score in scores]
    same = rulings[0] == rulings[1] and abs(rounds[0] - rounds[1]) <= 1
    return (
        same,
        f"trial {trial}: {rulings[0]}/{rulings[1]}, rounds {rounds[0]}/{rounds[1]}, {_parting(instance, *lanes)}",
    )


def _parting(instance: Instance, one: np.ndarray, two: np.ndarray) -> str:
    """Say which car is first in another lane in one simulation than in the other, for longer than a moment."""
    differs = (one[..., 0] != two[..., 0]) & (one[..., 0] >= 0) & (two[..., 0] >= 0)
    lasting = np.logical_and.reduce([differs[k : len(differs) - RATE + k] for k in range(RATE)])
    ticks, cars = np.nonzero(lasting)
    if len(ticks) == 0:
        return "the same lanes throughout, later"
    first = int(np.argmin(ticks))
    who, when = instance.names[cars[first]], ticks[first] / RATE
    return f"{who} took another lane first, at {when:.1f} s"
