"""Are cars of a world outside judged right, over ROS 1 and ROS 2, with all that a floor does to commands and poses?

    python -m experiments outside
    python -m experiments.outside [TRIALS]

`rules` drives among `lawful` cars whose poses come at 27 to 33 Hz with 5 mm of noise, and whose commands take effect
50 ms late, one in twenty never: in real time, with delay and noise measured before each trial. It needs what
scripts/system-packages.sh and scripts/crosscheck-tools.sh install.
"""

from __future__ import annotations

import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from benchmarks.table import Row, show
from tests.beside import in_domain
from tests.ports import kept_domain
from tests.ros import ROOT, configuration, finish, graph
from tests.tools import interpreter_with

import dubins_traffic as dt
from dubins_traffic.scoring.verdict import Ruling, Verdict

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
NOTICED: Final = "take effect about"
"""What a session says of a delay that is not declared."""


@dataclass(frozen=True, slots=True)
class Came:
    """What came of a trial: the verdict, the ticks of delay that were declared, and what the session said."""

    verdict: Verdict
    ticks: int
    said: str

    @property
    def untold(self) -> bool:
        """Whether it can't be told what came of it."""
        return self.verdict.verdict is Ruling.UNTOLD


def cars(instance: dt.Instance) -> list[str]:
    """Return names and starts, as worlds of the tests take them."""
    starts = zip(instance.names, instance.starts, strict=True)
    return [str(part) for name, pose in starts for part in (name, pose.x, pose.y, pose.theta)]


def over_ros1(config: Path, instance: dt.Instance, floor: str, *options: str) -> str:
    """Run a session over ROS 1 beside a world of its own; return what it said."""
    with graph(config.parent) as ros:
        ros.world(floor, cars(instance))
        return _said(finish(ros.session(config, *options, "--simulator", "ros1-world")))


def over_ros2(config: Path, instance: dt.Instance, floor: str, *options: str) -> str:
    """Run a session over ROS 2 beside a world of its own, by rclpy; return what it said."""
    domain = kept_domain()
    world = (interpreter_with("jazzy"), str(ROOT / "tests" / "ros2_world.py"), floor, *cars(instance))
    session = (sys.executable, "-m", "dubins_traffic.cli", "ros2", "run", str(config), "--json", *options)
    with in_domain(domain, *world), in_domain(domain, *session, "--simulator", "ros2-world") as run:
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
        record = dt.load_record(records / "trial-0000.mcap")
        verdict = dt.score(record).verdict
        assert verdict is not None
        return Came(verdict, record.instance.disturbances.command_delay, said)


def rows(transport: str, trials: int) -> list[Row]:
    """Return the rows of one transport."""
    every = [driven(transport, number, FLOOR) for number in range(trials)]
    unseen = driven(transport, 0, SLOW_FLOOR, "--delay", "0", "--noise", "0.005")
    broken = sorted(
        own.verdict.own_violations[0].rule for own in every if own.verdict.own_violations and not own.untold
    )
    satisfied = sum(own.verdict.verdict is Ruling.SATISFIED for own in every)
    clean, untold = sum(own.verdict.clean for own in every), sum(own.untold for own in every)
    rounds, ticks = sum(own.verdict.rounds for own in every), [own.ticks for own in every]
    return [
        Row(
            f"{transport}: trials of {trials} in which `rules` breaks a rule, and that is not named untold",
            f"{len(broken)}" + (f" ({', '.join(broken)})" if broken else ""),
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
