"""`dubins-traffic ros2 run`: process to process by Cyclone DDS, and against another implementation, Fast DDS."""

import json
import math
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cyclonedds")

import dubins_traffic as dt
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph
from tests.beside import running
from tests.conformance.transport import frames
from tests.ports import kept_domain
from tests.ros2_client import READY, RESET, RESTART, START, Client, law
from tests.tools import need, program

ROOT = Path(__file__).resolve().parents[2]
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))
LIBRARIES = ("-lfastrtps", "-lfastcdr")


class Law:
    """A deterministic controller of the position alone, whose doubles pass through odometry unchanged."""

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        return law(observation.pose.x, observation.pose.y)


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile what a trial needs before anyone waits for one."""
    with Trial(dt.draw(dt.load_config("demo"), 1, 0)) as trial:
        trial.advance((0.1, 0.1))


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> int:
    number = kept_domain()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(number))
    return number


@pytest.fixture
def config(tmp_path: Path) -> str:
    document = dt.load_config("demo").to_document() | {"duration_bounds": [4, 4]}
    (tmp_path / "short.json").write_text(json.dumps(document))
    return str(tmp_path / "short.json")


def reference(config: str, tmp_path: Path) -> tuple[bytes, Any]:
    instance = dt.draw(dt.load_config(config), 1, 0)
    run_trial(instance, Law(), record=tmp_path / "here.mcap")
    return frames(tmp_path / "here.mcap"), instance


def test_peers_are_counted_while_others_come_and_go(domain: int) -> None:
    """Cyclone's list of peers fails when one comes while it is made: some in a thousand counts here."""
    graph, over = Graph(domain), threading.Event()
    writer, reader = graph.writer("rt/counted", m.Twist), graph.reader("rt/counted", m.Twist)

    def come_and_go() -> None:
        others = Graph(domain, here=False)
        while not over.is_set():
            there = [others.writer("rt/counted", m.Twist), others.reader("rt/counted", m.Twist)]
            others.drop(there.pop())
            there.pop().__del__()
        others.close()

    thread = threading.Thread(target=come_and_go)
    thread.start()
    try:
        for _ in range(100_000):
            assert graph.heard(writer)
            assert graph.writers(reader) >= 1
    finally:
        over.set()
        thread.join()
        del writer, reader
        graph.close()


@pytest.mark.path
def test_process_to_process(domain: int, config: str, tmp_path: Path) -> None:
    expected, instance = reference(config, tmp_path)
    arguments = (
        "ros2",
        "run",
        config,
        "--seed",
        "1",
        "--lockstep",
        "--deadline",
        "60",
        "--trials",
        "2",
        "--records",
        str(tmp_path / "out"),
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
        out, _ = session.communicate(timeout=600)
        scans = client.graph.take(client.scans, m.LaserScan, 10)
        client.graph.close()
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert ends == ["reset", "duration", "reset"]
    assert frames(tmp_path / "out" / "trial-0000-1.mcap") == expected
    assert {label.split("_")[0] for label in client.seen} == {"ego", "agent0", "agent1"}
    assert scans
    assert len(scans[0].ranges) == 300


@pytest.fixture(scope="module")
def fastdds(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A driver of another implementation of DDS, built with Debian's libfastrtps-dev."""
    compiler = program("g++")
    here = Path("/usr/include/fastdds/dds/domain/DomainParticipant.hpp").exists()
    need("" if here else "libfastrtps-dev", "scripts/system-packages.sh installs it")
    built = tmp_path_factory.mktemp("dds") / "fastdds"
    source = ROOT / "tests" / "dds" / "fastdds.cpp"
    subprocess.run([compiler, "-std=c++17", "-Wall", "-Werror", "-o", built, source, *LIBRARIES], check=True)
    return str(built)


@pytest.mark.tools
def test_fast_dds_drives_the_ego(fastdds: str, domain: int, config: str, tmp_path: Path) -> None:
    expected, instance = reference(config, tmp_path)
    arguments = (
        "ros2",
        "run",
        config,
        "--seed",
        "1",
        "--lockstep",
        "--deadline",
        "60",
        "--trials",
        "1",
        "--records",
        str(tmp_path / "out"),
    )
    with running(COMMAND, *arguments) as session, running(fastdds, str(domain)) as driver:
        client = Client(domain)
        client.until(READY)
        assert client.ask(START)
        out, err = driver.communicate(timeout=600)
        session.communicate(timeout=600)
        client.graph.close()
    assert driver.returncode == 0, err
    problem, odometry = out.splitlines()
    assert json.loads(problem) == instance_to_document(instance, version=0)
    record = dt.load_record(tmp_path / "out" / "trial-0000.mcap")
    assert frames(tmp_path / "out" / "trial-0000.mcap") == expected
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
    arguments = ("ros2", "run", config, "--seed", "1", "--lockstep", "--deadline", "3", "--json")
    with running(COMMAND, *arguments, "--trials", "1") as session:
        client = Client(domain)
        client.until(START)
        client.instance()
        client.drive(20)
        if bad is not None:
            client.commands.write(m.Twist(m.Vector3(bad)))
        out, _ = session.communicate(timeout=600)
        client.graph.close()
    assert json.loads(out)["trials"][0]["end"] == end
    assert session.returncode == 1


def test_faulty_clients_end_their_trials_and_the_session_goes_on(domain: int, config: str, tmp_path: Path) -> None:
    document = json.loads(Path(config).read_text()) | {"duration_bounds": [60, 60]}
    Path(config).write_text(json.dumps(document))
    arguments = (
        "ros2",
        "run",
        config,
        "--silence",
        "4",
        "--trials",
        "5",
        "--records",
        str(tmp_path),
        "--json",
    )
    with running(COMMAND, *arguments) as session:
        for number, action in enumerate(("die", "stop", "flood", "nan", "reset")):
            with running(sys.executable, "-m", "tests.ros2_client", str(domain), action):
                await_end(tmp_path / f"trial-{number:04d}.wall.json")
        out, err = session.communicate(timeout=600)
    assert session.returncode == 1, err
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert ends == ["peer_lost", "peer_silent", "peer_flood", "controller_fault", "reset"]


def test_clients_that_go_less_than_the_silence_before_the_planned_end(domain: int, config: str, tmp_path: Path) -> None:
    """Four seconds are shorter than the silence that is borne."""
    arguments = ("ros2", "run", config, "--trials", "3", "--records", str(tmp_path), "--json")
    with running(COMMAND, *arguments) as session:
        for number, action in enumerate(("die", "stop")):
            with running(sys.executable, "-m", "tests.ros2_client", str(domain), action):
                await_end(tmp_path / f"trial-{number:04d}.wall.json")
        client = Client(domain)
        client.until(START)
        client.problem()
        client.drive()
        out, err = session.communicate(timeout=600)
        client.graph.close()
    assert session.returncode == 1, err
    ends = [trial["end"] for trial in json.loads(out)["trials"]]
    assert ends == ["peer_lost", "peer_silent", "duration"]
    assert dt.verify(tmp_path / "trial-0000.mcap").verified


def await_end(sidecar: Path) -> None:
    """Wait until a trial is over."""
    until = time.monotonic() + 600
    while not sidecar.exists():
        assert time.monotonic() < until, "the trial does not end"
        time.sleep(0.05)


def test_time_transforms_pausing_and_placing(domain: int, config: str, tmp_path: Path) -> None:
    arguments = ("ros2", "run", config, "--clock", "--trials", "1", "--records", str(tmp_path))
    with running(COMMAND, *arguments) as session:
        client = Client(domain)
        clocks = client.graph.reader("rt/clock", m.Clock)
        transforms = client.graph.reader("rt/tf", m.TFMessage)
        client.until(READY)
        client.place(1.25, -0.3)
        client.until(START)
        client.instance()
        client.drive(20)
        assert client.ask("PAUSE")
        client.watch(0.2)
        assert len(set(client.watch(0.5, times=30))) == 1
        assert client.ask("UNPAUSE")
        client.drive()
        _, err = session.communicate(timeout=600)
        times = [
            message.clock.sec + 1e-9 * message.clock.nanosec for message in client.graph.take(clocks, m.Clock, 1000)
        ]
        told = client.graph.take(transforms, m.TFMessage, 1000)
        client.graph.close()
    assert session.returncode == 0, err
    record = dt.load_record(tmp_path / "trial-0000.mcap")
    assert (record.instance.starts[0].x, record.instance.starts[0].y) == (1.25, -0.3)
    assert times == sorted(times)
    assert 4.0 < times[-1] < 60.0
    frames = {(each.header.frame_id, each.child_frame_id) for each in told[-1].transforms}
    assert {("map", "ego/odom"), ("ego/odom", "ego/base_footprint")} <= frames
    assert ("agent1/base_footprint", "agent1/base_link") in frames
    moved = next(each for each in told[-1].transforms if each.child_frame_id == "ego/base_footprint")
    assert moved.transform.translation.x == pytest.approx(float(record.frames.x[-1, 0]), abs=0.2)


def test_an_interrupted_session_a_second_one_and_no_domain(domain: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with running(COMMAND, "ros2", "run", "demo") as session:
        client = Client(domain)
        client.until(READY)
        with running(COMMAND, "ros2", "run", "demo") as second:
            _, err = second.communicate(timeout=600)
        assert second.returncode == 2
        assert "another session" in err
        session.send_signal(signal.SIGINT)
        _, err = session.communicate(timeout=600)
        client.graph.close()
    assert "interrupted after 0 trials" in err
    monkeypatch.setenv("ROS_DOMAIN_ID", "several")
    with running(COMMAND, "ros2", "run", "demo") as session:
        _, err = session.communicate(timeout=600)
    assert session.returncode == 2
    assert "ROS_DOMAIN_ID" in err


def test_the_example_passes_the_check() -> None:
    command = f"{sys.executable} {ROOT / 'examples' / 'ros2' / 'controller.py'}"
    done = subprocess.run(
        [COMMAND, "check-controller", command, "--over", "ros2"],
        check=False, capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    failed = [line for line in done.stdout.splitlines() if line.startswith("FAILED")]
    assert all("answers in time" in line for line in failed), done.stdout + done.stderr  # the machine may be busy
    assert done.stdout.count("ok ") + len(failed) == 7
