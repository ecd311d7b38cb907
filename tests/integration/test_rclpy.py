"""Nodes of ROS 2 as people have it, with rclpy and Fast DDS of two versions, beside `dubins-traffic ros2 run`.

`DUBINS_TRAFFIC_TRIALS_ROS2=50 pytest tests/integration/test_rclpy.py` runs the full count.
"""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")

import dubins_traffic as dt
from dubins_traffic.competition.templates import write_template
from dubins_traffic.kernels.trig import advance
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.transports import marks
from dubins_traffic.transports.ros2 import messages as m
from tests.beside import in_domain
from tests.ports import kept_domain
from tests.tools import interpreter_with

pytestmark = pytest.mark.tools

ROOT = Path(__file__).resolve().parents[2]
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))
VERSIONS = ("jazzy", "kilted")
TRIALS = os.environ.get("DUBINS_TRAFFIC_TRIALS_ROS2", "3")
PATIENCE = 900


def session(config: str, *more: str) -> tuple[str, ...]:
    return (COMMAND, "ros2", "run", config, "--seed", "1", "--json", *more)


@pytest.fixture
def config(tmp_path: Path) -> str:
    document = dt.load_config("demo").to_document() | {"duration_bounds": [4, 4]}
    (tmp_path / "short.json").write_text(json.dumps(document))
    return str(tmp_path / "short.json")


@pytest.fixture
def nodes(tmp_path: Path) -> Path:
    """The package of nodes that is shipped to begin from."""
    write_template("ros2", tmp_path / "nodes")
    return tmp_path / "nodes"


@pytest.fixture
def node_file(nodes: Path) -> str:
    return str(nodes / "controller.py")


def ends(process: subprocess.Popen[str]) -> list[str]:
    out, err = process.communicate(timeout=PATIENCE)
    assert out, err
    return [trial["end"] for trial in json.loads(out)["trials"]]


def ended_by_ctrl_c(node: subprocess.Popen[str]) -> None:
    """See that a node has printed nothing that it should not: no warning, no error."""
    node.send_signal(signal.SIGINT)
    out, err = node.communicate(timeout=PATIENCE)
    assert (out, err) == ("interrupted\n", "")


@pytest.mark.parametrize("version", VERSIONS)
def test_types_have_the_hashes_of_ros_2(version: str) -> None:
    share = Path(interpreter_with(version)).parents[1] / "share"
    kinds = [kind for kind in vars(m).values() if "::" in getattr(kind, "__idl_typename__", "")]
    compared = 0
    for kind in kinds:
        package, group, _, name = kind.__idl_typename__.split("::")
        told = share / package / group / f"{name.removesuffix('_')}.json"
        if told.exists() and package != "rmw_dds_common":  # bounds of its texts are left out
            assert json.loads(told.read_text())["type_hashes"][0]["hash_string"] == m.type_hash(kind)
            compared += 1
    assert compared >= 16


@pytest.mark.parametrize("version", VERSIONS)
def test_a_node_drives_trial_after_trial(version: str, config: str, node_file: str, tmp_path: Path) -> None:
    domain, python = kept_domain(), interpreter_with(version)
    arguments = session(
        config, "--lockstep", "--deadline", "60", "--trials", TRIALS, "--records", str(tmp_path / "out")
    )
    with in_domain(domain, *arguments) as run, in_domain(domain, python, node_file) as node:
        assert ends(run) == ["duration"] * int(TRIALS)
        ended_by_ctrl_c(node)
    driven = {float(dt.load_record(path).frames.x[-1, 0]) for path in (tmp_path / "out").glob("*.mcap")}
    assert len(driven) > 1


@pytest.mark.parametrize("version", VERSIONS)
def test_a_session_is_seen_as_a_node(version: str) -> None:
    domain, python = kept_domain(), interpreter_with(version)
    with (
        in_domain(domain, *session("demo", "--trials", "1")) as run,
        in_domain(domain, python, str(ROOT / "tests" / "rclpy_look.py"), "/ego/odom") as look,
    ):
        out, err = look.communicate(timeout=PATIENCE)
        assert err == ""
        seen = json.loads(out)
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=PATIENCE)
    assert "dubins_traffic" in seen["nodes"]
    ((kind, told),) = seen["publishers"]
    assert kind == "nav_msgs/msg/Odometry"
    assert told == m.type_hash(m.Odometry)
    assert not [name for name, _ in seen["services"] if "maestro" in name]


def test_two_sessions_in_two_domains(node_file: str, tmp_path: Path) -> None:
    """With the default settings of both versions, in real time: they don't hear each other."""
    documents: dict[str, Any] = {}
    for version, seconds in zip(VERSIONS, (4, 6), strict=True):
        documents[version] = dt.load_config("demo").to_document() | {"duration_bounds": [seconds, seconds]}
        (tmp_path / f"{version}.json").write_text(json.dumps(documents[version]))
    first, second = kept_domain(), kept_domain()
    with (
        in_domain(first, *session(str(tmp_path / "jazzy.json"), "--trials", "2")) as one,
        in_domain(second, *session(str(tmp_path / "kilted.json"), "--trials", "2")) as other,
        in_domain(first, interpreter_with("jazzy"), node_file) as node,
        in_domain(second, interpreter_with("kilted"), node_file) as another,
    ):
        assert ends(one) == ["duration"] * 2
        assert ends(other) == ["duration"] * 2
        ended_by_ctrl_c(node)
        ended_by_ctrl_c(another)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_killed_node_is_lost_at_once(version: str, node_file: str, tmp_path: Path) -> None:
    """DDS itself would notice after twenty seconds; the silence that is borne here is longer."""
    domain, python = kept_domain(), interpreter_with(version)
    document = dt.load_config("demo").to_document() | {"duration_bounds": [1000, 1000]}
    (tmp_path / "long.json").write_text(json.dumps(document))
    arguments = session(str(tmp_path / "long.json"), "--trials", "1", "--silence", "900")
    with in_domain(domain, *arguments) as run, in_domain(domain, python, node_file) as node:
        assert run.stderr is not None
        for line in run.stderr:
            if "first command" in line:
                break
        time_in = subprocess.run(
            [python, str(ROOT / "tests" / "rclpy_look.py"), "/ego/mobile_base/commands/velocity"],
            env=os.environ | {"ROS_DOMAIN_ID": str(domain)},
            check=True,
            capture_output=True,
            timeout=PATIENCE,
        )
        assert b"geometry_msgs/msg/Twist" in time_in.stdout
        node.kill()
        assert ends(run) == ["peer_lost"]


@pytest.mark.parametrize("version", VERSIONS)
def test_markers_show_roads_and_cars(version: str) -> None:
    """As RViz would draw them; of the roads who comes late is told, too."""
    domain, python = kept_domain(), interpreter_with(version)
    with (
        in_domain(domain, *session("town", "--trials", "1", "--markers")) as run,
        in_domain(domain, python, str(ROOT / "tests" / "rclpy_markers.py")) as viewer,
    ):
        out, err = viewer.communicate(timeout=PATIENCE)
        assert err == ""
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=PATIENCE)
    shown = json.loads(out)
    instance = dt.draw(dt.load_config("town"), 1, 0)
    problem, cars = instance.problem, len(instance.names)
    wipe, *roads = shown["roads"]
    assert wipe[:5] == ["map", "", 0, 0, marks.DELETE_ALL]
    groups = [one[1] for one in roads]
    assert groups.count("roads") == groups.count("lines") == problem.network.lanes // 2
    assert groups.count("intersections") == len(problem.network.points)
    bodies = [one for one in shown["cars"] if one[1] == "bodies"]
    assert [one[2] for one in bodies] == list(range(cars))
    for one, start in zip(bodies, instance.starts, strict=True):
        assert one[5:7] == [start.x, start.y]
        assert one[8] ** 2 - one[7] ** 2 == pytest.approx(start.c)
        assert one[11] == 1.0


MAIN = """
#include <iostream>
#include "controller.hpp"

int main() {
    Driver driver;
    std::string problem;
    std::getline(std::cin, problem);
    driver.begin(problem);
    nav_msgs::msg::Odometry seen;
    auto &pose = seen.pose.pose;
    while (std::cin >> pose.position.x >> pose.position.y >> pose.orientation.z >> pose.orientation.w) {
        const auto command = driver.command(seen);
        std::cout << command.linear.x << " " << command.angular.z << std::endl;
    }
    driver.begin("");
    std::cout << (driver.idle() ? "idle" : "busy") << std::endl;
}
"""
"""Drives where the lines say that the ego is."""


@pytest.mark.parametrize("version", VERSIONS)
def test_the_driver_in_cpp_goes_round_the_goals(version: str, nodes: Path) -> None:
    """It is built against the messages of ROS 2; rclcpp, of which the node itself is made, has no wheel."""
    include = Path(interpreter_with(version)).parents[1] / "include"
    (nodes / "main.cpp").write_text(MAIN)
    build = ["g++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "main.cpp", "-o", "drive"]
    build += [f"-isystem{folder}" for folder in sorted(include.iterdir())]
    subprocess.run(build, cwd=nodes, check=True)
    instance = dt.draw(dt.load_config("town"), 1, 0)
    goals = [tuple(instance.problem.network.points[v]) for v in instance.problem.goal_vertices]
    with subprocess.Popen([nodes / "drive"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as driver:
        assert driver.stdin is not None
        assert driver.stdout is not None
        driver.stdin.write(json.dumps(instance_to_document(instance, version=0)) + "\n")
        pose, met = tuple(instance.starts[0]), list[int]()
        for _ in range(5_000):
            x, y, c, s = pose
            turn = math.atan2(s, c) / 2.0
            driver.stdin.write(f"{x} {y} {math.sin(turn)} {math.cos(turn)}\n")
            driver.stdin.flush()
            speed, yaw_rate = map(float, driver.stdout.readline().split())
            pose = advance(*pose, speed, yaw_rate, 1.0 / 30.0)
            near = [
                k
                for k, goal in enumerate(goals)
                if math.dist(goal, pose[:2]) < instance.problem.intersection_radius / 2.0
            ]
            met += [k for k in near if met[-1:] != [k]]
        out, _ = driver.communicate(timeout=PATIENCE)
    assert out == "idle\n"
    assert len(goals) > 1
    assert len(met) > 2 * len(goals)
    assert met == [k % len(goals) for k in range(len(met))]


def test_the_package_is_one_that_colcon_knows(nodes: Path) -> None:
    """Debian's catkin_pkg reads it; the launch file is Python."""
    asked = "import sys; from catkin_pkg.package import parse_package; print(parse_package(sys.argv[1]).name)"
    told = subprocess.run(["/usr/bin/python3", "-c", asked, nodes], capture_output=True, text=True, check=True).stdout
    assert told == "traffic_nodes\n"
    compile((nodes / "trials.launch.py").read_text(), "trials.launch.py", "exec")
    installed = (nodes / "CMakeLists.txt").read_text()
    assert all(name in installed for name in ("controller.cpp", "controller.py", "trials.launch.py"))
