"""The ROS 1 interface of 2016 with a real roscore, and programs that know names and types alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import dubins_traffic as dt
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.record.sink import End
from dubins_traffic.sessions.plan import rehearse
from dubins_traffic.transports.ros1.master import pid_at
from dubins_traffic.transports.ros1.messages import MD5, load
from tests.ros import ROOT, SYSTEM_PYTHON, Graph, configuration, finish, graph, lines, need_ros, read_until

pytestmark = [pytest.mark.tools, pytest.mark.filterwarnings("ignore::DeprecationWarning")]


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile beforehand what trials need, so that nobody waits for it in vain."""
    rehearse(dt.draw(dt.load_config("demo")))


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Graph]:
    need_ros()
    with graph(tmp_path) as made:
        yield made


@pytest.fixture(scope="module")
def nodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The examples and a client in C++, built with g++ against Debian's roscpp."""
    need_ros()
    folder = tmp_path_factory.mktemp("nodes")
    messages = [
        sys.executable,
        "-m",
        "dubins_traffic.cli",
        "ros1",
        "messages",
        str(folder / "include"),
        "--cpp",
    ]
    subprocess.run(messages, check=True, capture_output=True)
    flags = subprocess.run(["pkg-config", "--cflags", "--libs", "roscpp"], check=True, capture_output=True, text=True)
    builds = []
    for source in ("examples/ros1/controller.cpp", "examples/ros1/wander.cpp", "tests/ros_client.cpp"):
        command = [
            "g++",
            "-Wall",
            "-Wextra",
            "-Werror",
            "-isystem",
            folder / "include",
            ROOT / source,
            "-o",
            folder / Path(source).stem,
        ]
        builds.append(subprocess.Popen([*command, *flags.stdout.split()]))
    assert [build.wait(600) for build in builds] == [0, 0, 0]
    return folder


def ends(folder: Path) -> dict[str, End | None]:
    found = {path.stem: dt.load_record(path).ending for path in sorted(folder.glob("*.mcap"))}
    return {name: None if ending is None else ending.end for name, ending in found.items()}


def test_message_sums_are_those_of_2016() -> None:
    need_ros()
    messages = load()
    assert {kind: getattr(messages, kind.partition("/")[2])._md5sum for kind in MD5} == dict(MD5)


def test_a_python_client_goes_through_trials_resets_and_restarts(ros: Graph, tmp_path: Path) -> None:
    session = begun(ros, tmp_path)
    seen = through(session, ros.client("drive", "reset:10", "restart:10", "drive"), tmp_path)
    assert seen[0]["names"] == ["ego", "agent0", "agent1"]
    assert seen[0]["states"] >= 1.5 * 100
    assert seen[0]["odometry"] >= 1.5 * 25
    assert seen[0]["scans"] >= 10
    data = json.loads((tmp_path / "data.json").read_text())
    assert len(data["instances"]) == 4


def test_a_client_in_cpp_goes_through_trials_resets_and_restarts(ros: Graph, tmp_path: Path, nodes: Path) -> None:
    session = begun(ros, tmp_path)
    client = ros.start([nodes / "ros_client", "drive", "reset", "restart", "drive"])
    seen = through(session, client, tmp_path)
    assert [each["sent"] >= 10 for each in seen] == [True] * 4
    frames = dt.load_record(tmp_path / "out" / "trial-0000.mcap").frames
    assert frames.command_speed[1:, 0].mean() > 0.2


def begun(ros: Graph, folder: Path) -> subprocess.Popen[str]:
    """Start a session of three short trials."""
    config = configuration(folder, duration=1.5)
    return ros.session(config, "--records", folder / "out", "-f", folder / "data.json")


def through(session: subprocess.Popen[str], client: subprocess.Popen[str], folder: Path) -> list[dict[str, Any]]:
    """Return what a client has seen that drove, asked RESET, asked RESTART and drove."""
    status, out, err = finish(client)
    assert status == 0, err
    seen = lines(out)
    status, out, err = finish(session)
    assert status == 0, err
    assert [(each["started"], each["again"], each["last"]) for each in seen] == [(True, False, "")] * 4
    assert not any(each["refused"] for each in seen)
    assert ends(folder / "out") == {
        "trial-0000": End.DURATION,
        "trial-0001": End.RESET,
        "trial-0002": End.RESET,
        "trial-0002-1": End.DURATION,
    }
    assert seen[0]["problem"].keys() == {"version", "goals", "rnd", "intersection_radius"}
    assert seen[2]["problem"] == seen[3]["problem"] != seen[1]["problem"]
    assert sum("_s_" in label for label in seen[0]["labels"]) == 3
    return seen


def test_programs_in_cpp_drive_the_ego_and_an_e_agent(ros: Graph, tmp_path: Path, nodes: Path) -> None:
    records, roads = tmp_path / "out", tmp_path / "roads.json"
    config = configuration(tmp_path, duration=3.0)
    roads.write_text(json.dumps(json.loads(config.read_text())["rnd"]))
    session = ros.session(config, "--remote", "agent0", "--records", records)
    ros.start([nodes / "wander", roads, "cmd_vel:=mobile_base/commands/velocity"], ROS_NAMESPACE="agent0")
    controller = ros.start([nodes / "controller", "__ns:=ego"])
    status, out, err = finish(session)
    assert status == 0, err
    assert finish(controller)[0] == 0
    assert ends(records) == dict.fromkeys(("trial-0000", "trial-0001", "trial-0002"), End.DURATION)
    frames = dt.load_record(records / "trial-0000.mcap").frames
    for car in (0, 1):
        assert abs(frames.command_speed[:, car]).sum() + abs(frames.command_yaw_rate[:, car]).sum() > 5
    header = dt.load_record(records / "trial-0000.mcap").instance
    assert [agent.kind for agent in header.e_agents] == ["remote", "wander"]
    assert [row["end"] for row in json.loads(out)["trials"]] == ["duration"] * 3


def test_lockstep_over_ros_gives_the_frames_of_the_process(ros: Graph, tmp_path: Path) -> None:
    records = tmp_path / "out"
    config = configuration(tmp_path, duration=6.0, number_trials=1)
    session = ros.session(config, "--lockstep", "--records", records)
    client = ros.client("drive")
    assert finish(session)[0] == 0
    assert finish(client)[0] == 0
    over = dt.load_record(records / "trial-0000.mcap")
    here = tmp_path / "here.mcap"
    dt.run_trial(over.instance, f"{ROOT}/tests/smooth.py:Smooth", record=here)
    frames, expected = over.frames, dt.load_record(here).frames
    assert len(frames) == len(expected) == 181
    assert max(abs(frames.x - expected.x).max(), abs(frames.y - expected.y).max()) <= 1e-6
    assert abs(frames.c * expected.s - frames.s * expected.c).max() <= 1e-6
    again = tmp_path / "again.mcap"
    dt.run_trial(over.instance, Scripted.of(over), record=again)
    replayed = dt.load_record(again).frames
    for column in ("x", "y", "c", "s", "speed", "yaw_rate", "command_speed", "command_yaw_rate"):
        assert getattr(replayed, column).tobytes() == getattr(frames, column).tobytes()


def test_an_ego_over_ros_drives_under_the_shield(ros: Graph, tmp_path: Path) -> None:
    config = configuration(tmp_path, duration=6.0, number_trials=1, rules={})
    session = ros.session(config, "--lockstep", "--shield", "--records", tmp_path)
    client = ros.client("drive")
    status, out, err = finish(session)
    assert status == 0, err
    assert finish(client)[0] == 0
    (score,) = json.loads(out)["trials"]
    assert (score["end"], score["controller"], score["verdict"]["clean"]) == ("duration", "ros1+shield", True)
    record = dt.load_record(tmp_path / "trial-0000.mcap")
    assert sum(event.kind == "shield" for event in record.frames.events) == score["interventions"] > 0


def test_faulty_clients_end_their_trials_and_the_session_goes_on(ros: Graph, tmp_path: Path) -> None:
    records = tmp_path / "out"
    config = configuration(tmp_path, duration=30.0, number_trials=5)
    session = ros.session(config, "--records", records, "--silence", "5")
    for number, action in enumerate(("die:5", "stop:5", "flood:5", "nan:5")):
        client = ros.client(action)
        _wait_for_end(records, number)
        os.killpg(client.pid, signal.SIGKILL)
        finish(client)
    finish(ros.client("reset:5"))
    status, _, err = finish(session)
    assert status == 1, err
    assert list(ends(records).values()) == [
        End.PEER_LOST,
        End.PEER_SILENT,
        End.PEER_FLOOD,
        End.CONTROLLER_FAULT,
        End.RESET,
    ]


def _wait_for_end(records: Path, number: int) -> None:
    until = time.monotonic() + 600
    while time.monotonic() < until:
        path = records / f"trial-{number:04d}.wall.json"
        if path.exists():
            return
        time.sleep(0.05)
    pytest.fail("the trial does not end")


def test_a_master_that_is_killed_ends_the_session(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path) as ros:
        records = tmp_path / "out"
        session = ros.session(configuration(tmp_path, duration=30.0), "--records", records)
        ros.client("drive")
        while not list(records.glob("*.mcap")):
            time.sleep(0.05)
        master = pid_at(ros.uri)
        assert master is not None
        os.kill(master, signal.SIGKILL)
        status, _, err = finish(session)
    assert status == 2
    assert "master" in err
    assert ends(records) == {"trial-0000": End.TRANSPORT_LOST}


@pytest.mark.parametrize("running", [True, False], ids=["in a trial", "between trials"])
def test_a_session_whose_node_is_displaced_ends(ros: Graph, tmp_path: Path, running: bool) -> None:
    records = tmp_path / "out"
    session = ros.session(configuration(tmp_path, duration=600.0), "--records", records)
    if running:
        ros.client("drive")
    read_until(session, "begins" if running else "waiting for READY")
    while running and not list(records.glob("*.mcap")):
        time.sleep(0.05)
    code = "import rospy; rospy.init_node('dubins_traffic_maestro'); rospy.spin()"
    ros.start([SYSTEM_PYTHON, "-c", code])
    status, _, err = finish(session)
    assert status == 2
    assert "shut this node down" in err
    assert "new node registered with same name" in err
    assert ends(records) == ({"trial-0000": End.TRANSPORT_LOST} if running else {})


DISPLACED = """
import threading
import time
from dubins_traffic.protocols import End, Ending
from dubins_traffic.transports.inbox import Inbox
from dubins_traffic.transports.ros1.node import join
from dubins_traffic.transports.ros1.transport import Ros1
from tests.recordings import make_instance

class Heard(Inbox):
    def stop(self, end, detail):
        super().stop(end, detail)
        print(end.value, detail, flush=True)

rospy = join({uri!r})
rospy.core.add_preshutdown_hook(lambda reason: time.sleep(1.0))
heard, transport = Heard(1000), Ros1({uri!r})
transport.open(heard)
transport.begin(make_instance(names=("agent0",)), ["ego"])
shutdown = threading.Thread(target=rospy.signal_shutdown, args=("another has its name",))
shutdown.start()
while shutdown.is_alive():
    transport.end(Ending(End.RESET, 0, ""))
"""
"""A session that publishes all the time while the master shuts its node down, which closes all topics first."""


def test_who_is_displaced_says_so_however_much_it_publishes_meanwhile(ros: Graph) -> None:
    session = ros.start([sys.executable, "-c", DISPLACED.format(uri=ros.uri)])
    status, out, err = finish(session)
    assert status == 0, err
    assert out == "transport_lost the ROS master has shut this node down: another has its name\n"


def test_two_programs_that_drive_one_car_are_told_of_at_once_and_counted(ros: Graph, tmp_path: Path) -> None:
    records = tmp_path / "out"
    session = ros.session(configuration(tmp_path, number_trials=1), "--records", records)
    code = (
        "import rospy; from geometry_msgs.msg import Twist; rospy.init_node('other');"
        "out = rospy.Publisher('/ego/mobile_base/commands/velocity', Twist, queue_size=1); rospy.spin()"
    )
    ros.start([SYSTEM_PYTHON, "-c", code])
    client = ros.client("drive")
    read_until(session, "2 programs send commands for ego at once")
    assert not list(records.glob("*.wall.json"))
    assert finish(client)[0] == 0
    assert finish(session)[0] == 0
    wall = json.loads((records / "trial-0000.wall.json").read_text())
    assert wall["transport"]["drivers"]["ego"]["peers"] == 2


def test_own_master_port_in_use_second_maestro_and_interruption(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path, core=False) as ros:
        config = configuration(tmp_path)
        status, _, err = finish(ros.session(config))
        assert status == 2
        assert "no ROS master answers" in err
        first = ros.session(config, "--master", "--port", str(ros.port), "__name:=x", "__log:=/dev/null")
        ros.await_master()
        assert finish(ros.client("drive"))[0] == 0
        status, _, err = finish(ros.session(config, "--master", "--port", str(ros.port)))
        assert (status, "in use" in err) == (2, True)
        status, _, err = finish(ros.session(config))
        assert (status, "maestro already" in err) == (2, True)
        children = Path(f"/proc/{first.pid}/task/{first.pid}/children").read_text().split()
        assert children
        os.kill(first.pid, signal.SIGTERM)
        status, _, err = finish(first)
        assert status == 1
        assert "interrupted after 1 trials" in err
        assert not any(Path(f"/proc/{child}").exists() for child in children)


def test_a_launch_file_starts_a_session_with_its_controller(tmp_path: Path) -> None:
    need_ros()
    with graph(tmp_path, core=False) as ros:
        config = configuration(tmp_path, number_trials=1, duration=1.5)
        ros.client_messages()
        options = [f"config:={config}", f"options:=--records {tmp_path / 'out'}"]
        roslaunch = [SYSTEM_PYTHON, str(shutil.which("roslaunch")), "-p", str(ros.port)]
        launch = ros.start(
            [*roslaunch, "dubins_traffic_nodes", "trials.launch", *options],
            ROS_PACKAGE_PATH=str(ROOT / "examples" / "ros1"),
            DUBINS_TRAFFIC=f"{sys.executable} -m dubins_traffic.cli",
            PYTHONPATH=str(tmp_path / "messages"),
        )
        finish(launch)
        assert ends(tmp_path / "out") == {"trial-0000": End.DURATION}


def test_cars_are_placed_before_a_trial_and_time_stands_still_while_paused(ros: Graph, tmp_path: Path) -> None:
    records = tmp_path / "out"
    session = ros.session(configuration(tmp_path, number_trials=1, duration=1.0), "--clock", "--records", records)
    status, out, err = finish(ros.client("place", "pause:5"))
    assert status == 0, err
    placed, paused = lines(out)
    assert placed["x"] == pytest.approx(1.25)
    assert paused["moved"] == 0.0
    assert paused["states_while_paused"] >= 40
    assert finish(session)[0] == 0
    record = dt.load_record(records / "trial-0000.mcap")
    assert record.instance.starts[0].x == pytest.approx(1.25)
    assert record.ending is not None
    assert record.ending.end is End.DURATION
