import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.cars.body import Car, Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.sensing import Surroundings, rays_at, scan
from dubins_traffic.cars.tables import pack_cars, pack_obstacles
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo import prefix
from dubins_traffic.gazebo.link import LostError, MessageKind
from dubins_traffic.gazebo.server import PREFIX, Folder
from dubins_traffic.gazebo.simulator import Gazebo
from dubins_traffic.gazebo.world import WHEEL_RADIUS
from dubins_traffic.kernels.records import numbers
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import replay
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.score import Scorer
from dubins_traffic.verification.worlds import from_poses
from tests.batches import pose, scene
from tests.gazebo import installation
from tests.recordings import make_instance
from tests.tools import need

pytestmark = pytest.mark.tools

PROGRAM = [sys.executable, "-m", "dubins_traffic.cli"]
WANDERERS = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "network": {"grid": {"rows": 3, "columns": 4}},
    "e-agents": [{"type": "wander", "name": "agent", "count": 3}],
    "duration": 60,
    "number_goals_bounds": [2, 2],
    "rules": True,
}


@pytest.fixture(autouse=True)
def installed() -> Iterator[None]:
    """Gazebo is there, and no server is left when the test is over."""
    installation()
    yield
    assert servers_of(os.getpid()) == []


def servers_of(parent: int) -> list[int]:
    """Return the gzservers that the process `parent` has started, whoever their parent is now."""
    mark = f"DUBINS_TRAFFIC_GAZEBO_PARENT={parent}\0".encode()
    found: list[int] = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (folder / "environ").read_bytes() and b"gzserver" in (folder / "cmdline").read_bytes():
                found.append(int(folder.name))
        except OSError:
            continue
    return found


def gone_within(seconds: float, parent: int) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if not servers_of(parent):
            return True
        time.sleep(0.05)
    return False


def command(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    around = {key: value for key, value in os.environ.items() if key != "DISPLAY"} | environment
    return subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, timeout=600, check=False, env=around)


def end_or_stop(process: int, sign: int) -> None:
    """Send a signal that ends or stops a process, and wait until none of its threads goes on."""
    os.kill(process, sign)
    while any(state not in "TZX" for state in states(process)):
        time.sleep(0.001)


def states(process: int) -> list[str]:
    """Return the states of the threads of a process, by Linux's letters; none where it has gone."""
    found: list[str] = []
    for stat in Path(f"/proc/{process}/task").glob("*/stat"):
        with contextlib.suppress(OSError):
            found.append(stat.read_text().rpartition(")")[2].split()[0])
    return found


class Meddler:
    """A controller that drives on and at a tick does something to the server."""

    def __init__(self, simulator: Gazebo, act: Callable[[int], object]) -> None:
        self.simulator, self.meddle = simulator, act

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        assert self.simulator.server is not None
        if observation.tick == 30:
            self.meddle(self.simulator.server.process.pid)
        return 0.3, 0.0


def test_a_trial_on_wheels_is_scored_replayed_and_the_same_again(tmp_path: Path) -> None:
    instance = dt.draw(dt.load_config(WANDERERS), 3, 0)
    embedded = run_trial(instance)
    twice = [tmp_path / "one.mcap", tmp_path / "two.mcap"]
    results = [run_trial(replace(instance, simulator="gazebo"), record=path) for path in twice]
    assert twice[0].read_bytes() == twice[1].read_bytes()
    score = results[0].score
    assert results[0].ending.end is End.DURATION
    for other in (score, embedded.score):
        assert other.verdict is not None
        assert other.driven.distance_m > 5.0
    record = dt.load_record(twice[0])
    assert record.instance.simulator == "gazebo"
    assert dt.verify(twice[0]).verified
    again = Scorer()
    replay(record, [again])
    assert again.result(controller="lanes", record=twice[0], wall=results[0].wall) == score


class Rammer:
    """Drives into what is ahead, again and again."""

    def start(self, problem: dt.Problem) -> None:
        self.problem = problem

    def act(self, observation: dt.Observation) -> tuple[float, float]:
        return (1.0, 0.0) if observation.tick % 40 < 30 else (-0.5, 0.3)


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_records_with_collisions_are_verified_and_their_contacts_fit_the_poses(
    body: Disc | Rectangle, tmp_path: Path
) -> None:
    post = [DiscObstacle(4.6, -0.3, 0.1)]
    instance = make_instance(names=("agent0",), ticks=200, body=body, obstacles=post)
    run_trial(replace(instance, simulator="gazebo"), Rammer(), record=tmp_path / "a.mcap")
    record = dt.load_record(tmp_path / "a.mcap")
    assert record.frames.contacts
    found = dt.verify(tmp_path / "a.mcap")
    assert found.verified, found
    assert from_poses(record).frames.contacts == record.frames.contacts
    bare = replace(record, frames=replace(record.frames, contacts=()))
    assert not dt.verify(bare).verified


@pytest.mark.parametrize(
    ("sign", "why"), [(signal.SIGKILL, "ended by SIGKILL"), (signal.SIGSTOP, "not answered for 2 s")]
)
def test_a_server_that_dies_or_hangs_ends_its_trial_by_name(sign: int, why: str) -> None:
    simulator = Gazebo(patience=2.0)
    meddler = Meddler(simulator, lambda pid: end_or_stop(pid, sign))
    result = run_trial(make_instance(names=("agent0",)), meddler, simulator=simulator)
    assert result.ending.end is End.WORLD_LOST
    assert why in result.ending.detail
    assert 29 <= result.ending.ticks <= 31


def test_a_server_killed_while_it_starts_ends_its_trial_and_the_next_one_follows(tmp_path: Path) -> None:
    file, out, real = tmp_path / "short.json", tmp_path / "out", installation()
    file.write_text(
        json.dumps(WANDERERS | {"duration": 2, "simulator": "gazebo", "laser": {"rays": 20}}),
        encoding="utf-8",
    )
    first = tmp_path / "gzserver"
    killed = f"[ -e {tmp_path}/once ] || {{ : > {tmp_path}/once; kill -KILL $$; }}"
    first.write_text(f'#!/bin/sh\n{killed}\nexec {real.gzserver} "$@"\n')
    first.chmod(0o755)
    other = prefix.Installation(tmp_path, first, real.root)
    prefix.write_manifest(tmp_path, first, own=real.root is None, version="11")
    other.plugin.parent.mkdir(parents=True)
    for own, found in ((other.plugin, real.plugin), (other.confinement, real.confinement)):
        own.symlink_to(found)
    if real.root is not None:
        (tmp_path / "root").symlink_to(real.root)
    done = command(
        "run",
        str(file),
        "--trials",
        "2",
        "--records",
        str(out),
        "--json",
        DUBINS_TRAFFIC_GAZEBO=str(tmp_path),
    )
    assert done.returncode == 1, done.stderr
    assert [trial["end"] for trial in json.loads(done.stdout)["trials"]] == ["world_lost", "duration"]
    lost = dt.load_record(out / "trial-0000.mcap")
    assert lost.ending is not None
    assert (lost.ending.ticks, len(lost.frames)) == (0, 1)
    assert "ended by SIGKILL, while it started" in lost.ending.detail
    assert (lost.frames.x[0, 0], lost.frames.y[0, 0]) == lost.instance.starts[0][:2]
    assert dt.verify(out / "trial-0000.mcap").verified


def test_a_port_in_use_is_named() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port is in use: got {port}"):
            Gazebo(port=port).reset([scene([pose(0, 0)])])


def test_it_listens_on_the_loopback_interface_only() -> None:
    simulator = Gazebo()
    simulator.reset([scene([pose(0, 0)])])
    assert simulator.server is not None
    folder = Path(f"/proc/{simulator.server.process.pid}")
    own = {str(file.readlink()) for file in (folder / "fd").iterdir() if file.is_symlink()}
    rows = [line.split() for line in (folder / "net" / "tcp").read_text().splitlines()[1:]]
    listening = [row[1] for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own]
    simulator.close()
    assert listening
    assert all(address.startswith("0100007F:") for address in listening)


def test_cars_can_be_placed_and_nonsense_is_refused() -> None:
    simulator = Gazebo()
    simulator.reset([scene([pose(0, 0), pose(2, 0)])])
    assert simulator.server is not None
    places = np.array([pose(1, 2, 0.5), pose(-3, 4, -2.5)])
    placed = simulator.server.ask(MessageKind.PLACE, places.ravel()).reshape(2, 7)
    assert placed[:, :4] == pytest.approx(places, abs=1e-9)
    assert not placed[:, 4:].any()
    rate = 0.5 / WHEEL_RADIUS
    moved = simulator.server.ask(MessageKind.STEP, np.array([210, rate, rate, 0.0, 0.0])).reshape(2, 7)
    assert moved[0, :2] == pytest.approx(places[0, :2] + 0.5 * places[0, 2:], abs=0.01)
    assert moved[1, :4] == pytest.approx(places[1], abs=1e-4)
    with pytest.raises(LostError, match="refused STEP"):
        simulator.server.ask(MessageKind.STEP, np.zeros(2))
    simulator.close()


def a_prefix(folder: Path) -> prefix.Installation:
    """Return another prefix with the same Gazebo."""
    found = installation()
    prefix.write_manifest(folder, found.gzserver, own=found.root is None, version="11")
    if found.root is not None:
        (folder / "root").symlink_to(found.root)
    return prefix.Installation(folder, found.gzserver, found.root)


def test_a_plugin_that_is_missing_or_broken(tmp_path: Path) -> None:
    other = a_prefix(tmp_path)
    with pytest.raises(InputError, match="plugin has gone"):
        Gazebo(tmp_path)
    other.plugin.parent.mkdir()
    other.plugin.write_bytes(b"no library")
    other.confinement.symlink_to(installation().confinement)
    with pytest.raises(InputError, match="can't be started"):
        Gazebo(tmp_path).reset([scene([pose(0, 0)])])


def test_half_an_installation(tmp_path: Path) -> None:
    (tmp_path / "apt").mkdir()
    done = command("run", "demo", "--simulator", "gazebo", DUBINS_TRAFFIC_GAZEBO=str(tmp_path))
    assert done.returncode == 2
    assert "was not finished" in done.stderr
    assert "gazebo install" in done.stderr
    doctor = command("gazebo", "doctor", "--prefix", str(tmp_path))
    assert doctor.returncode == 1
    assert "BAD  installation" in doctor.stdout


def test_no_room_to_write(tmp_path: Path) -> None:
    run = ["1", *PROGRAM, "run", "demo", "--simulator", "gazebo"]
    install = ["0", *PROGRAM, "gazebo", "install", "--prefix", str(tmp_path)]
    for words in (run, install):
        full = ["bash", "-c", 'ulimit -f "$1" && shift && exec "$@"', "full", *words]
        done = subprocess.run(full, capture_output=True, text=True, timeout=600, check=False)
        assert done.returncode == 2, done.stderr
        assert "File too large" in done.stderr


def test_no_display() -> None:
    done = command("run", "demo", "--simulator", "gazebo", "--gui")
    assert done.returncode == 2
    assert "no display" in done.stderr


def test_a_killed_run_leaves_no_server_and_the_next_run_removes_its_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    file = tmp_path / "long.json"
    file.write_text(json.dumps(WANDERERS | {"duration": 3600, "rules": False}))
    run = subprocess.Popen(
        [*PROGRAM, "run", str(file), "--simulator", "gazebo"],
        stdout=subprocess.DEVNULL,
        env=os.environ | {"TMPDIR": str(tmp_path)},
    )
    while not servers_of(run.pid) and run.poll() is None:
        time.sleep(0.05)
    living = Folder()
    assert len(list(tmp_path.glob(f"{PREFIX}*"))) == 2
    run.kill()
    run.wait()
    assert gone_within(600.0, run.pid)
    next_one = Folder()
    assert set(tmp_path.glob(f"{PREFIX}*")) == {living.path, next_one.path}
    for folder in (living, next_one):
        folder.cleanup()
    assert not list(tmp_path.glob(f"{PREFIX}*"))


def test_two_workers_make_the_records_of_one(tmp_path: Path) -> None:
    file = tmp_path / "short.json"
    file.write_text(json.dumps(WANDERERS | {"duration": 4, "simulator": "gazebo"}))
    for jobs in ("1", "2"):
        done = command("run", str(file), "--trials", "2", "--jobs", jobs, "--records", str(tmp_path / jobs))
        assert done.returncode == 0, done.stderr
    for name in ("trial-0000.mcap", "trial-0001.mcap"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_lasers_and_contacts_are_those_of_the_bodies(body: Disc | Rectangle) -> None:
    wall = PolygonObstacle(((1.5, -1.0), (2.5, -1.0), (2.5, 2.0), (2.0, 0.0), (1.5, 1.0)))
    starts = [pose(0, 0), pose(1, 3, 1.0), pose(-1, 2, 0.5)]
    one = scene(starts, Car(body=body), [DiscObstacle(0, -2, 0.5), wall])
    rays = rays_at(np.linspace(-3.0, 3.0, 200))
    simulator = Gazebo()
    state = simulator.reset([one])
    seen = simulator.scan(0, numbers(rays, np.float64), 5.0)
    expected = np.zeros(200)
    around = Surroundings(state, pack_cars([one.problem.car]), pack_obstacles([one.problem.obstacles]))
    scan(0, 0, 0.0, 5.0, rays, expected, around)
    contacts = [
        contact for _ in range(120) for contact in simulator.step(np.array([[[0.5, 0.0], [0.0, 0.0], [0.0, 0.0]]]))[0]
    ]
    simulator.close()
    assert np.minimum(expected, 5.0) == pytest.approx(seen, abs=0.003)  # a sharp corner is a wall thick
    (contact,) = contacts
    assert (contact.car, contact.other) == (0, -2)
    assert contact.x == pytest.approx(1.5, abs=0.01)
    assert (contact.nx, contact.ny) == pytest.approx((1.0, 0.0), abs=0.02)
    assert contact.closing == pytest.approx((0.5, 0.0), abs=0.01)
    assert contact.moved == (True, False)


def test_roads_are_worlds_that_others_can_read(tmp_path: Path) -> None:
    instance = dt.draw(dt.load_config(WANDERERS | {"obstacles": [{"disc": {"x": -3, "y": 0, "radius": 1}}]}), 0, 0)
    network = tmp_path / "instance.json"
    network.write_text(json.dumps(instance_to_document(instance)))
    for version in ("1.6", "1.9"):
        world = tmp_path / f"{version}.sdf"
        assert command("convert", str(network), "-o", str(world), "--sdf", version).returncode == 0
        assert world.read_text().count('<visual name="surface">') == 17
    found = installation()
    check = [str(found.gzserver.with_name("gz")), "sdf", "-k", str(tmp_path / "1.6.sdf")]
    old = subprocess.run(
        check, capture_output=True, text=True, env=os.environ | found.environment(), check=True, timeout=600
    )
    assert "Check complete" in old.stdout
    ask = "import ctypes,sys; ctypes.CDLL('libsdformat12.so.12').cmdCheck(sys.argv[1].encode())"
    new = subprocess.run(
        [sys.executable, "-c", ask, str(tmp_path / "1.9.sdf")], capture_output=True, text=True, check=False
    )
    need("libsdformat12" if "cannot open shared object" in new.stderr else "", "scripts/gazebo.sh installs it")
    assert new.stdout.strip() == "Valid."
    assert new.returncode == 0, new.stderr


def test_an_installation_that_is_interrupted_says_how_to_go_on(tmp_path: Path) -> None:
    prefix_folder = tmp_path / "prefix"
    process = subprocess.Popen(
        [*PROGRAM, "gazebo", "install", "--prefix", str(prefix_folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    while "list of packages" not in process.stdout.readline():
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=600)
    assert process.returncode == 1
    assert err == "dubins-traffic: interrupted; the same command goes on where it stopped\n"
