"""Are cars of a world outside judged right, over ROS 1 and ROS 2, with all that a floor does to commands and poses?

    python -m experiments outside
    python -m experiments.outside [TRIALS]

`rules` drives among `lawful` cars whose poses come at 27 to 33 Hz with 5 mm of noise, and whose commands take effect
50 ms late, one in twenty never: in real time, with delay and noise measured before each trial. It needs what
scripts/system-packages.sh and scripts/crosscheck-tools.sh install.
"""

from __future__ import annotations

import os
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.table import Row, show
from tests.beside import running
from tests.ros import Graph, configuration, finish, graph
from tests.tools import interpreter_with

import dubins_traffic as dt

ROOT: Final = Path(__file__).resolve().parents[1]
FLOOR, SLOW_FLOOR = "0.05,0.005,0.05", "0.3,0.0,0.0"
"""What worlds do, as tests/cars_outside.py has it: seconds late, metres of noise, share of commands lost."""
TRIALS: Final = 10
TRIAL: Final[dict[str, Any]] = {
    "rnd": {"version": 0, "length": 4, "transform": [0, 0, 0], "shape": [2, 3]},
    "e-agents": [{"type": "lawful", "name": "lawful", "count": 4}],
    "number_goals": 2,
    "rules": True,
    "duration": 120.0,
    "number_trials": 1,
}
"""What is driven, beside the defaults of `tests.ros.configuration`."""
SEED: Final = 3
DOMAIN: Final = 140
NOTICED: Final = "take effect about"
"""What a session says of a delay that is not declared."""


@dataclass(frozen=True, slots=True)
class Came:
    """What came of a trial: the record's verdict, and what the session said."""

    record: dt.Record
    said: str

    @property
    def verdict(self) -> Any:
        """The verdict."""
        return dt.score(self.record).verdict

    @property
    def wrong(self) -> bool:
        """Whether the ego broke a rule as measured, and that is not said to be untold."""
        return bool(self.verdict.own_violations) and self.verdict.verdict != "untold"


def cars(instance: dt.Instance) -> list[str]:
    """Return names and starts, as worlds of the tests take them."""
    starts = zip(instance.names, instance.starts, strict=True)
    return [str(part) for name, pose in starts for part in (name, pose.x, pose.y, pose.theta)]


def over_ros1(config: Path, instance: dt.Instance, floor: str, *options: str) -> str:
    """Run a session over ROS 1 beside a world of its own; return what it said."""
    with graph(config.parent) as ros:
        return _session_of(ros, config, instance, floor, *options)


def _session_of(ros: Graph, config: Path, instance: dt.Instance, floor: str, *options: str) -> str:
    messages = ros.client_messages()
    world = ["/usr/bin/python3", ROOT / "tests" / "ros_world.py", floor, *cars(instance)]
    ros.start(world, PYTHONPATH=str(messages))
    return _said(finish(ros.session(config, *options, "--simulator", "ros1-world")))


def over_ros2(config: Path, instance: dt.Instance, floor: str, *options: str) -> str:
    """Run a session over ROS 2 beside a world of its own, by rclpy; return what it said."""
    domain = str(DOMAIN + os.getpid() % 40)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "RMW_"))}
    environment["ROS_DOMAIN_ID"] = domain
    world = (interpreter_with("jazzy"), str(ROOT / "tests" / "ros2_world.py"), floor, *cars(instance))
    session = (sys.executable, "-m", "dubins_traffic.cli", "ros2", "run", str(config), "--json", *options)
    with ExitStack() as stack:
        stack.enter_context(running(*world, env=environment))
        run = stack.enter_context(running(*session, "--simulator", "ros2-world", env=environment))
        return _said(finish(run))


def _said(finished: tuple[int, str, str]) -> str:
    status, out, err = finished
    if status not in (0, 1):
        raise SystemExit(f"experiments: outside: a session failed: {out}{err}")
    return err


OVER: Final = {"ROS 1": over_ros1, "ROS 2": over_ros2}


def driven(transport: str, number: int, floor: str, *options: str) -> Came:
    """Run one trial over a transport, in a world that does `floor`."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        config, records = configuration(folder, **TRIAL), folder / "out"
        instance = dt.draw(dt.load_config(config), SEED + number, 0)
        told = ("--controller", "rules", "--seed", str(SEED + number), "--records", str(records), *options)
        said = OVER[transport](config, instance, floor, *told)
        return Came(dt.load_record(records / "trial-0000.mcap"), said)


def rows(transport: str, trials: int) -> list[Row]:
    """Return the rows of one transport."""
    every = [driven(transport, number, FLOOR) for number in range(trials)]
    unseen = driven(transport, 0, SLOW_FLOOR, "--delay", "0", "--noise", "0.005")
    broken = [own.verdict.own_violations[0].rule for own in every if own.wrong]
    satisfied, clean = (
        sum(own.verdict.verdict == "satisfied" for own in every),
        sum(own.verdict.clean for own in every),
    )
    untold = sum(own.verdict.verdict == "untold" for own in every)
    rounds = sum(own.verdict.rounds for own in every)
    ticks = [own.record.instance.disturbances.command_delay for own in every]
    return [
        Row(
            f"{transport}: trials of {trials} in which `rules` breaks a rule, and that is not named untold",
            f"{len(broken)}" + (f" ({', '.join(sorted(broken))})" if broken else ""),
            "0",
            not broken,
        ),
        Row(
            "the others",
            f"{clean} clean ({satisfied} satisfied), {untold} untold, {rounds} rounds in all",
            "",
            True,
        ),
        Row(
            "delay as measured, ticks of 1/30 s, the age of poses included",
            f"{min(ticks)} to {max(ticks)}",
            "",
            True,
        ),
        Row(
            "a delay of 0.3 s that is declared to be 0",
            "noticed and said" if NOTICED in unseen.said else "not noticed",
            "noticed and said",
            NOTICED in unseen.said,
        ),
    ]


def measure(trials: int = TRIALS) -> list[Row]:
    """Run the trials of both transports at once, and return the table."""
    with ThreadPoolExecutor(len(OVER)) as pool:
        return [row for found in pool.map(lambda name: rows(name, trials), OVER) for row in found]


if __name__ == "__main__":
    show("worlds outside", measure(int(sys.argv[1]) if len(sys.argv) > 1 else TRIALS))
