"""A world that is not ours over ROS 2, judged by our referee; `tests/ros2_world.py` is that world, by rclpy."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")

import dubins_traffic as dt
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.record.sink import End
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph
from dubins_traffic.transports.ros2.transport import INSTANCE
from tests.beside import in_domain
from tests.integration.test_rclpy import COMMAND, PATIENCE, VERSIONS
from tests.judged_outside import (
    COURSE,
    FAULTS,
    SMOOTH,
    require_driven,
    require_lost,
    require_measured,
    verified,
)
from tests.ports import kept_domain
from tests.ros import CARS, ROOT, configuration
from tests.tools import interpreter_with

pytestmark = pytest.mark.tools


def world(version: str, fault: str) -> tuple[str, ...]:
    return (interpreter_with(version), str(ROOT / "tests" / "ros2_world.py"), fault, *CARS)


def session(folder: Path, *options: str, **more: Any) -> tuple[str, ...]:
    config = configuration(folder, **{**COURSE, **more})
    records = ("--records", str(folder / "out"))
    return (COMMAND, "ros2", "run", str(config), "--simulator", "ros2-world", *records, *options)


def judged(folder: Path, fault: str, version: str = "jazzy", **more: Any) -> tuple[dt.Record, str]:
    domain = kept_domain()
    arguments = session(folder, "--controller", SMOOTH, **more)
    with in_domain(domain, *world(version, fault)), in_domain(domain, *arguments) as run:
        out, err = run.communicate(timeout=PATIENCE)
    assert run.returncode in (0, 1), out + err
    return verified(folder / "out", "ros2-world"), err


@pytest.mark.parametrize("version", VERSIONS)
def test_cars_elsewhere_are_driven_and_judged_here(version: str, tmp_path: Path) -> None:
    record, _ = judged(tmp_path, "none", version)
    require_driven(record)


@pytest.mark.parametrize(("fault", "word"), FAULTS)
def test_a_world_that_fails_ends_the_trial_with_its_reason(tmp_path: Path, fault: str, word: str) -> None:
    record, _ = judged(tmp_path, fault, duration=20.0)
    require_lost(record, word)


def test_a_world_is_measured_before_its_first_trial(tmp_path: Path) -> None:
    record, said = judged(tmp_path, "0.05,0.005,0.0", rules=False, duration=2.0)
    require_measured(record, said)


def test_a_node_drives_the_ego_and_another_maestro_starts_and_ends_the_trial(tmp_path: Path) -> None:
    """What it tells is what ROS 2's latched topic of the problem carries; the cars stay where they are."""
    domain = kept_domain()
    problem = instance_to_document(dt.draw(dt.load_config(configuration(tmp_path, **COURSE))), version=0)
    arguments = session(tmp_path, "--maestro-elsewhere", duration=2.0)
    with in_domain(domain, *world("jazzy", "none")), in_domain(domain, *arguments) as run:
        graph = Graph(domain)
        told = graph.writer(INSTANCE, m.String, latched=True)
        poses = graph.reader("rt/ego/pose", m.PoseStamped, lossy=True)
        commands = graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        assert run.stderr is not None
        for line in run.stderr:
            if re.search("waiting for a problem instance", line):
                break
        graph.put(told, m.String(json.dumps(problem)))
        where = 0.0
        while where < 1.0:
            for seen in graph.take(poses, m.PoseStamped, 100):
                where = seen.pose.position.x
                graph.put(commands, m.Twist(m.Vector3(0.3)))
            graph.wait(0.02)
        graph.put(told, m.String())
        out, err = run.communicate(timeout=PATIENCE)
        graph.close()
    assert run.returncode in (0, 1), out + err
    record = dt.load_record(tmp_path / "out" / "trial-0000.mcap")
    assert record.ending is not None
    assert record.ending.end is End.DURATION
    assert record.instance.simulator == "ros2-world"
    assert record.frames.x[-1, 0] > 0.7


def test_options_that_don_t_go_together_are_refused(tmp_path: Path) -> None:
    for options, word in (
        (("--lockstep",), "--simulator: a world outside has its own time"),
        (("--poses", "/pose"), "--poses: not a topic for every car"),
        (("--simulator", "ros1-world"), "--simulator: a world of another transport"),
    ):
        with in_domain(kept_domain(), *session(tmp_path, "--controller", SMOOTH, *options)) as run:
            _, err = run.communicate(timeout=PATIENCE)
        assert run.returncode == 2
        assert word in err
    assert not list(tmp_path.glob("out/*"))
