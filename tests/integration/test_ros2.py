"""`dubins-traffic ros2 run`: process to process by Cyclone DDS, and against another implementation, Fast DDS."""

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")

import dubins_traffic as dt
from dubins_traffic.campaign.single import Trial, run_trial
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph
from tests.conformance.transport import frames
from tests.tools import program

ROOT = Path(__file__).resolve().parents[2]
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))
READY, START, RESET, RESTART = 4, 5, 0, 1
DOMAINS = itertools.count(20 + 20 * (os.getpid() % 10))
LIBRARIES = ("-lfastrtps", "-lfastcdr")


class Law:
    """A deterministic controller of the position alone, whose doubles pass through odometry unchanged."""

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        return law(observation.pose.x, observation.pose.y)


def law(x: float, y: float) -> tuple[float, float]:
    return 0.25 + 0.01 * x, 0.3 * y


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile what a trial needs before anyone waits for one."""
    with Trial(dt.draw(dt.load_config("demo"), 1, 0)) as trial:
        trial.advance((0.1, 0.1))


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> int:
    number = next(DOMAINS)
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    return number


@pytest.fixture
def config(tmp_path: Path) -> str:
    document = dt.load_config("demo").to_document() | {"duration_bounds": [4, 4]}
    (tmp_path / "short.json").write_text(json.dumps(document))
    return str(tmp_path / "short.json")


@contextmanager
def running(*command: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate(timeout=20)


class Client:
    """The maestro's client and the ego's driver, from names and types alone."""

    def __init__(self, domain: int) -> None:
        self.graph = Graph(domain)
        maestro = "dubins_traffic_maestro"
        self.requests = self.graph.writer(f"rq/{maestro}/modeRequest", m.ModeRequest)
        self.replies = self.graph.reader(f"rr/{maestro}/modeReply", m.ModeReply)
        self.instances = self.graph.reader(f"rt/{maestro}/probleminstance_JSON", m.ProblemInstanceJSON)
        self.labels = self.graph.reader("rt/loutput", m.LabelStamped)
        self.scans = self.graph.reader("rt/agent0/scan", m.LaserScan)
        self.states = self.graph.reader("rt/gazebo/model_states", m.ModelStates)
        self.commands = self.graph.writer("rt/ego/mobile_base/commands/velocity", m.Twist)
        self.number = 0
        self.seen: set[str] = set()

    def ask(self, mode: int) -> bool | None:
        """Return what the maestro says, None if nothing within a second."""
        self.number += 1
        self.requests.write(m.ModeRequest(1234, self.number, mode))
        until = time.monotonic() + 1.0
        while time.monotonic() < until:
            for reply in self.graph.take(self.replies, m.ModeReply, 10):
                if (reply.guid, reply.seq) == (1234, self.number):
                    return reply.result
            self.graph.wait(0.05)
        return None

    def until(self, mode: int) -> None:
        """Ask until it is granted."""
        end = time.monotonic() + 120
        while not self.ask(mode):
            assert time.monotonic() < end

    def instance(self) -> str:
        """Wait for the next problem, or for the empty one that ends a trial."""
        end = time.monotonic() + 20
        while time.monotonic() < end:
            for message in self.graph.take(self.instances, m.ProblemInstanceJSON, 1):
                return message.problemjson
            self.graph.wait(0.05)
        raise AssertionError("no instance")

    def drive(self, most: int | None = None) -> int:
        """Answer frames until the trial is over, or some; return how many."""
        answered, last = 0, time.monotonic()
        while most is None or answered < most:
            for states in self.graph.take(self.states, m.ModelStates, 100):
                position = states.pose[states.name.index("ego")].position
                speed, yaw_rate = law(position.x, position.y)
                self.commands.write(m.Twist(m.Vector3(speed), m.Vector3(z=yaw_rate)))
                answered, last = answered + 1, time.monotonic()
            for message in self.graph.take(self.labels, m.LabelStamped, 10):
                self.seen |= set(message.label)
            if self.graph.take(self.instances, m.ProblemInstanceJSON, 1):
                return answered
            assert time.monotonic() - last < 20
            self.graph.wait(0.01)
        return answered


def reference(config: str, tmp_path: Path) -> tuple[bytes, Any]:
    instance = dt.draw(dt.load_config(config), 1, 0)
    run_trial(instance, Law(), record=tmp_path / "here.mcap")
    return frames(tmp_path / "here.mcap"), instance


def test_process_to_process(domain: int, config: str, tmp_path: Path) -> None:
    expected, instance = reference(config, tmp_path)
    arguments = (
        "ros2",
        "run",
        config,
        "--seed",
        "1",
        "--lockstep",
        "--trials",
        "2",
        "--records",
        str(tmp_path),
    )
    with running(COMMAND, *arguments, "--json") as session:
        client = Client(domain)
        client.until(READY)
        assert client.ask(START)
        assert json.loads(client.instance()) == instance_to_document(instance, version=0)
        assert client.ask(START) is False
        client.drive(30)
        assert client.ask(RESTART)
        assert client.instance() == ""
        client.until(START)
        assert json.loads(client.instance()) == instance_to_document(instance, version=0)
        assert client.drive() >= instance.ticks
        client.until(START)
        assert client.instance() != ""
        client.drive(10)
        assert client.ask(RESET)
        out, _ = session.communicate(timeout=30)
        scans = client.graph.take(client.scans, m.LaserScan, 10)
        client.graph.close()
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert ends == ["reset", "duration", "reset"]
    assert frames(tmp_path / "trial-0000-1.mcap") == expected
    assert {label.split("_")[0] for label in client.seen} == {"ego", "agent0", "agent1"}
    assert scans
    assert len(scans[0].ranges) == 300


@pytest.fixture(scope="module")
def fastdds(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A driver of another implementation of DDS, built with Debian's libfastrtps-dev."""
    compiler = program("g++")
    if not Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp").exists():
        pytest.skip("libfastrtps-dev is not here: scripts/system-packages.sh installs it")
    built = tmp_path_factory.mktemp("dds") / "fastdds"
    source = ROOT / "tests" / "dds" / "fastdds.cpp"
    subprocess.run([compiler, "-std=c++17", "-Wall", "-Werror", "-o", built, source, *LIBRARIES], check=True)
    return str(built)


def test_fast_dds_drives_the_ego(fastdds: str, domain: int, config: str, tmp_path: Path) -> None:
    expected, instance = reference(config, tmp_path)
    arguments = (
        "ros2",
        "run",
        config,
        "--seed",
        "1",
        "--lockstep",
        "--trials",
        "1",
        "--records",
        str(tmp_path),
    )
    with running(COMMAND, *arguments) as session, running(fastdds, str(domain)) as driver:
        client = Client(domain)
        client.until(READY)
        assert client.ask(START)
        out, err = driver.communicate(timeout=60)
        session.communicate(timeout=20)
        client.graph.close()
    assert driver.returncode == 0, err
    problem, odometry = out.splitlines()
    assert json.loads(problem) == instance_to_document(instance, version=0)
    record = dt.load_record(tmp_path / "trial-0000.mcap")
    assert frames(tmp_path / "trial-0000.mcap") == expected
    frame, child, *numbers = odometry.split()
    assert (frame, child) == ("ego/odom", "ego/base_footprint")
    block = record.frames
    columns = (block.x, block.y, block.speed, block.yaw_rate)
    last = [tuple(float(column[k, 0]) for column in columns) for k in (-1, -2)]
    assert tuple(map(float, numbers)) in last


@pytest.mark.parametrize(
    ("bad", "end"), [(math.nan, "controller_fault"), (None, "deadline")], ids=["not finite", "silent"]
)
def test_a_bad_peer_ends_its_trial_by_name(bad: float | None, end: str, domain: int, config: str) -> None:
    arguments = ("ros2", "run", config, "--seed", "1", "--lockstep", "--deadline", "0.5", "--json")
    with running(COMMAND, *arguments, "--trials", "1") as session:
        client = Client(domain)
        client.until(START)
        client.instance()
        client.drive(20)
        if bad is not None:
            client.commands.write(m.Twist(m.Vector3(bad)))
        out, _ = session.communicate(timeout=30)
        client.graph.close()
    assert json.loads(out)["trials"][0]["end"] == end
    assert session.returncode == 1


def test_an_interrupted_session_and_no_domain(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with running(COMMAND, "ros2", "run", "demo") as session:
        client = Client(domain)
        client.until(READY)
        session.send_signal(signal.SIGINT)
        _, err = session.communicate(timeout=20)
        client.graph.close()
    assert "interrupted after 0 trials" in err
    monkeypatch.setenv("ROS_DOMAIN_ID", "several")
    with running(COMMAND, "ros2", "run", "demo") as session:
        _, err = session.communicate(timeout=20)
    assert session.returncode == 2
    assert "ROS_DOMAIN_ID" in err


def test_the_example_passes_the_check() -> None:
    command = f"{sys.executable} {ROOT / 'examples' / 'ros2' / 'controller.py'}"
    done = subprocess.run(
        [COMMAND, "check-controller", command, "--over", "ros2"],
        check=False, capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
