"""`python -m experiments.verify [COUNT]`: records of every kind of driver, world and transport, each verified.

Trials differ in network, cars, obstacles, disturbances, e-agents and controller, and in what carries the commands.
LCM, ROS 1 and ROS 2 need a network of their own: `tests/conformance` verifies the record of every trial over every
transport, and `tests/integration/test_gazebo.py` those of Gazebo.
"""

from __future__ import annotations

import random
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from benchmarks.table import Row, show

import dubins_traffic as dt
from dubins_traffic.controllers.registry import load
from dubins_traffic.problem.instance import Instance
from dubins_traffic.sessions.remote import hand_over
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.lines import Lines
from dubins_traffic.transports.lines_client import drive
from dubins_traffic.transports.link import Link

COUNT = 500
AGENTS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("wander", {}),
    ("wander", {"patience": 1.0}),
    ("loop", {}),
    ("follow", {}),
    ("follow", {"sensing_only": True}),
    ("parked", {"vacates_after": 2.0}),
    ("scripted", {"commands": [[1.0, 0.3, 0.1], [0.5, 0.0, -1.0], [1.0, 9.0, 9.0]], "repeat": True}),
    ("lawful", {}),
    ("lawful", {"goes": "loop"}),
    ("lawful", {"rolls": 0.5, "left": 0.3, "blocks": 0.3}),
    ("nemesis", {}),
)
BODIES: tuple[dict[str, Any], ...] = (
    {},
    {},
    {"body": {"rectangle": {"length": 0.4, "width": 0.2}}},
    {"bounds": {"speed": 0.8, "speed_min": 0.1, "yaw_rate": 1.5, "turning_radius": 0.3}},
)
DISTURBANCES: tuple[dict[str, Any], ...] = (
    {},
    {},
    {"position_noise": 0.02, "heading_noise": 0.05},
    {"command_delay": 3},
    {"command_loss": 0.2},
    {"command_delay": 2, "command_loss": 0.4},
)
NEEDS_LAW = ("rules", "simple+shield", "lanes+shield", "wild+shield")
CONTROLLERS = ("lanes", "simple", "wild", "gives up", "raises", *NEEDS_LAW)
WAYS = ("here", "here", "here", "stepped", "lines", "remote e-agent", "batch")


class Wild:
    """Drives at random, out of bounds now and then; may give up or raise at a tick."""

    def __init__(self, gives_up: int = -1, raises: int = -1) -> None:
        self._gives_up, self._raises = gives_up, raises

    def start(self, problem: dt.Problem) -> None:
        """Begin the same random numbers again."""
        self._draw = random.Random(len(problem.network.segments))

    def act(self, observation: dt.Observation) -> tuple[float, float] | None:
        """Return a command that no road asks for."""
        if observation.tick == self._raises:
            raise ArithmeticError("no more")
        if observation.tick == self._gives_up:
            return None
        return self._draw.uniform(-2.0, 3.0), self._draw.uniform(-4.0, 4.0)

    def report(self) -> list[tuple[str, str]]:
        """Say something now and then."""
        return [("mood", "wild")] if self._draw.random() < 0.05 else []


def controller(name: str) -> Any:
    """Return one of `CONTROLLERS`."""
    made: dict[str, Callable[[], Any]] = {
        "wild": Wild,
        "gives up": lambda: Wild(gives_up=77),
        "raises": lambda: Wild(raises=50),
        "wild+shield": lambda: dt.Shield(Wild()),
    }
    return made[name]() if name in made else load(name)


def case(number: int) -> tuple[dict[str, Any], str, str]:
    """Return configuration, controller and way of case `number`."""
    draw = random.Random(number)
    name, way = CONTROLLERS[number % len(CONTROLLERS)], draw.choice(WAYS)
    lawful = name in NEEDS_LAW
    agents = [draw.choice(AGENTS) for _ in range(draw.randrange(5))]
    keep_rules = any(kind in ("lawful", "nemesis") for kind, _ in agents)
    plain = lawful or keep_rules
    network: dict[str, Any] = {"grid": {"rows": 3, "columns": 4, "removed": draw.choice((0.0, 0.15))}}
    if draw.random() < 0.3 and not plain:
        network = {"random": {"intersections": 12, "segments": 15, "rigid_motion": True}}
    obstacles = [{"disc": {"x": 4.5, "y": -0.42, "radius": 0.15}}] if draw.random() < 0.3 else []
    document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": network,
        "e-agents": [{"type": kind, "name": f"car{k}", "parameters": given} for k, (kind, given) in enumerate(agents)],
        "duration": draw.choice((3.0, 8.5, 15.0)),
        "number_goals_bounds": [2, 4],
        "car": {} if plain else draw.choice(BODIES),
        "rate": draw.choice((30.0, 30.0, 20.0, 29.97)),
        "disturbances": draw.choice(DISTURBANCES),
        "laser": draw.random() < 0.2,
        "rules": plain,
        "end_on_collision": draw.random() < 0.3,
        "obstacles": [] if plain or "random" in network else obstacles,
    }
    return document, name, way


def record(instance: Instance, name: str, way: str, path: Path) -> None:
    """Run a case and record it."""
    if way == "stepped":
        _step(instance, path)
    elif way in ("lines", "remote e-agent"):
        _over_lines(instance, name, path, ego=way == "lines")
    else:
        dt.run_trial(instance, controller(name), record=path)


def _step(instance: Instance, path: Path) -> None:
    """Step a trial from Python, and leave it before its end."""
    driver = Wild()
    driver.start(instance.problem)
    with dt.Trial(instance, record=path) as trial:
        while trial.ending is None and trial.tick < 100:
            command = driver.act(trial.observation)
            for said in driver.report():
                trial.note(*said)
            trial.step(command or (0.0, 0.0))


def _over_lines(instance: Instance, name: str, path: Path, *, ego: bool) -> None:
    if not ego and not instance.e_agents:
        ego = True
    car = "ego" if ego else instance.names[1]
    given = instance if ego else hand_over(instance, [car])
    link = Link(Lines(), Lockstep(), ego=ego)
    try:
        with ThreadPoolExecutor(1) as pool:
            address = link.transport.address  # pyright: ignore[reportAttributeAccessIssue]
            future = pool.submit(drive, address, Wild(), car)
            dt.run_trial(given, "" if ego else controller(name), record=path, link=link)
            future.result(60)
    finally:
        link.close()


def verified(count: int, folder: Path) -> tuple[Counter[str], list[str], tuple[float, float]]:
    """Return how many records of each way were accepted, what was not, and seconds of running and of verifying."""
    accepted: Counter[str] = Counter()
    refused: list[str] = []
    ran = checked = 0.0
    for number in range(count):
        document, name, way = case(number)
        try:
            instance = dt.draw(dt.load_config(document), number, number % 7)
        except dt.InputError as error:
            refused.append(f"case {number} can't be drawn: {error}")
            continue
        path = folder / f"{number}.mcap"
        paths = [path]
        began = time.perf_counter()
        if way == "batch":
            paths = _batch(document, number, folder / str(number))
        else:
            record(instance, name, way, path)
        ran += time.perf_counter() - began
        began = time.perf_counter()
        found = [dt.verify(each) for each in paths]
        checked += time.perf_counter() - began
        accepted[way] += all(one.verified for one in found)
        refused += [f"case {number}, {name} {way}: {one}" for one in found if not one.verified]
    return accepted, refused, (ran, checked)


def _batch(document: dict[str, Any], seed: int, folder: Path) -> list[Path]:
    """Run a batch that keeps its records."""
    dt.run_batch(dt.load_config(document), "lanes", trials=2, seed=seed, keep="all", records=folder)
    return sorted(folder.glob("*.mcap"))


def measure(count: int = COUNT) -> list[Row]:
    """Verify `count` records."""
    with tempfile.TemporaryDirectory() as folder:
        accepted, refused, (ran, checked) = verified(count, Path(folder))
    for line in refused:
        print(line, file=sys.stderr)
    ways = ", ".join(f"{way} {number}" for way, number in sorted(accepted.items()))
    total = sum(accepted.values())
    return [
        Row(f"records verified of {count}", f"{total}: {ways}", "all", total == count),
        Row("verifying", f"{checked:.1f} s; running took {ran:.1f} s", "<= running", checked <= ran),
    ]


if __name__ == "__main__":
    raise SystemExit(0 if show("verify", measure(int([*sys.argv, COUNT][1]))) else 1)
