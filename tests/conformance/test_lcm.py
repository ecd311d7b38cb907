import ast
import shutil
import socket
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("lcm", reason="LCM's wheel needs libglib2.0-0: scripts/system-packages.sh installs it")

from lcm import LCM
from scripts import lcm_messages

from dubins_traffic.errors import InputError, TransportError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.parts import Laser
from dubins_traffic.protocols import End
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.inbox import Inbox
from dubins_traffic.transports.lcm import connection
from dubins_traffic.transports.lcm.connection import url_of_its_own
from dubins_traffic.transports.lcm.dubins_traffic_lcm import (
    command_t,
    end_t,
    instance_t,
    state_t,
    world_t,
)
from dubins_traffic.transports.lcm.encoding import (
    Encoder,
    observation_from_message,
    problem_from_message,
    problem_to_message,
)
from dubins_traffic.transports.lcm.transport import Lcm
from dubins_traffic.transports.link import Link
from tests.conformance.transport import UntypedConformance, frames, slalom
from tests.recordings import make_instance
from tests.tools import need

pytestmark = pytest.mark.tools

ROOT = Path(__file__).resolve().parents[2]
KEPT = ExitStack()
"""Ports of URLs that were given out."""


def free_url() -> str:
    """Return a URL of multicast within this machine that nobody else uses while the tests run."""
    return KEPT.enter_context(url_of_its_own())


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Compile what a trial needs before anyone waits for one."""
    with Trial(make_instance(names=("agent0",), ticks=5)) as trial:
        trial.advance((0.1, 0.1))


class LcmPeer:
    """A peer written from the message definitions alone."""

    def __init__(self, url: str, car: str) -> None:
        self.url, self.car = url, car
        self.trial: int | None = None
        self.again()

    def again(self) -> None:
        self.lcm = LCM(self.url)
        self.inbox: list[Any] = []
        for channel, kind in (
            ("TRAFFIC_INSTANCE", instance_t),
            (f"TRAFFIC_STATE_{self.car}", state_t),
            ("TRAFFIC_END", end_t),
        ):
            self.lcm.subscribe(channel, lambda _, data, kind=kind: self.inbox.append(kind.decode(data)))

    def get(self) -> Any:
        while not self.inbox:
            assert self.lcm.handle_timeout(600_000) > 0
        return self.inbox.pop(0)

    def problem(self) -> None:
        if self.trial is not None:
            return
        while not isinstance(message := self.get(), instance_t):
            pass
        self.trial = message.trial

    def frame(self) -> int | None:
        while isinstance(message := self.get(), instance_t):
            self.trial = message.trial
        return message.tick if isinstance(message, state_t) else self.over()

    def over(self) -> None:
        self.trial = None

    def send(self, speed: float, yaw_rate: float, tick: int) -> None:
        command = command_t()
        command.trial, command.tick = self.trial or 0, tick
        command.speed, command.yaw_rate = speed, yaw_rate
        self.lcm.publish(f"TRAFFIC_COMMAND_{self.car}", command.encode())

    def garbage(self) -> None:
        self.lcm.publish(f"TRAFFIC_COMMAND_{self.car}", b"\xff\x00 no message at all")

    def hang_up(self) -> None:
        if hasattr(self, "lcm"):
            del self.lcm


class TestLcm(UntypedConformance):
    detects_loss = False

    def make(self) -> Lcm:
        return Lcm(free_url())

    def connect(self, transport: Lcm, car: str) -> LcmPeer:
        return LcmPeer(transport.url, car)


def bare(text: str) -> str:
    """Return a module of Python without what it says of itself."""
    tree = ast.parse(text)
    for part in ast.walk(tree):
        if isinstance(part, ast.Module | ast.ClassDef | ast.FunctionDef):
            part.body = [
                own for own in part.body if not (isinstance(own, ast.Expr) and isinstance(own.value, ast.Constant))
            ]
    return ast.unparse(tree)


def test_our_code_of_the_messages_does_what_that_of_lcm_gen_does(tmp_path: Path) -> None:
    prefix = "dubins_traffic.transports.lcm"
    generator = Path(sys.executable).with_name("lcm-gen")
    command = [
        generator,
        "--python",
        "--ppath",
        tmp_path,
        "--package-prefix",
        prefix,
        lcm_messages.DEFINITION,
    ]
    subprocess.run(command, check=True, capture_output=True)
    theirs = {path.name: bare(path.read_text()) for path in tmp_path.rglob("*.py") if path.parent.name.endswith("_lcm")}
    lcm_messages.make(tmp_path / "ours")
    assert {path.name: bare(path.read_text()) for path in (tmp_path / "ours").iterdir()} == theirs
    assert len(theirs) == 10


def test_the_quick_encoder_makes_the_bytes_of_the_generated_code() -> None:
    instance = replace(make_instance(names=("agent0", "agent1"), ticks=30))
    instance = replace(instance, problem=replace(instance.problem, laser=Laser(rays=7)))
    with Trial(instance) as trial:
        for tick in range(5):
            trial.advance(slalom(tick))
        seen, state, labels = trial.observation, trial._state, trial._labels
    encoder = Encoder(instance.names)
    data = encoder.state(seen, 3, 0)
    assert state_t.decode(data).encode() == data
    assert len(state_t.decode(data).others) == 2
    assert observation_from_message(state_t.decode(data), instance.problem)[:6] == seen[:6]
    assert state_t.decode(data).scan == tuple(seen.scan.tolist())
    data = encoder.world(-1, 5, 5 / 30, state, labels)
    world = world_t.decode(data)
    assert world.encode() == data
    assert [car.name for car in world.car] == list(instance.names)
    assert [car.x for car in world.car] == state.x[0].tolist()


def test_numbers_for_programs_that_read_no_json() -> None:
    problem = make_instance().problem
    message = instance_t.decode(problem_to_message(problem, 5).encode())
    assert problem_from_message(message) == problem
    assert [tuple(message.intersection[goal]) for goal in message.goal] == [
        tuple(problem.network.points[vertex]) for vertex in problem.goal_vertices
    ]
    assert message.speed_max == problem.car.bounds.speed


def test_equal_frames_from_a_controller_in_another_process(tmp_path: Path) -> None:
    here, there = tmp_path / "here.mcap", tmp_path / "there.mcap"
    instance = draw(load_config("demo"), 1, 0)
    instance = replace(instance, duration=4.0)
    run_trial(instance, "lanes", record=here)
    url = free_url()
    code = (
        "from dubins_traffic.controllers.registry import load; from dubins_traffic.transports.lcm.client import drive;"
        f"print(drive(load('lanes'), {url!r}).reason)"
    )
    link = Link(Lcm(url), Lockstep(30.0))
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True) as peer:
        try:
            result = run_trial(instance, record=there, link=link)
        finally:
            link.close()
        said, _ = peer.communicate(timeout=600)
    assert result.ending.end is End.DURATION
    assert said == "duration\n"
    assert frames(there) == frames(here)


def test_a_second_session_at_one_url_is_refused() -> None:
    first = Link(Lcm(free_url()), Lockstep(1.0))
    pool = ThreadPoolExecutor(1)
    try:
        second = pool.submit(Lcm(first.transport.url).open, Inbox(10))
        while not second.done():
            first.transport.receive(0.01)
        with pytest.raises(TransportError, match="another session"):
            second.result()
    finally:
        first.close()
        pool.shutdown()


def test_the_port_of_a_url_of_its_own_is_kept() -> None:
    with url_of_its_own() as url:
        port = int(url.split(":")[2].split("?")[0])
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger,
            pytest.raises(OSError, match="in use"),
        ):
            stranger.bind(("", port))
        here, there, heard = LCM(url), LCM(url), list[bytes]()
        there.subscribe("A", lambda _, data: heard.append(data))
        here.publish("A", b"word")
        while not heard:
            there.handle_timeout(1000)


@pytest.mark.parametrize("url", ["nonsense", "udpm://1.2.3.4:7667", "udpm://239.255.76.67:port"])
def test_a_url_that_is_none(url: str) -> None:
    with pytest.raises(InputError, match="url"):
        Lcm(url).open(Inbox(10))


def without_network(code: str, before: str = "true") -> str:
    """Return what a Python program prints in a network of its own that has no route, after a shell command."""
    command = ["unshare", "-rn", "sh", "-c", f'{before}; exec "$0" -c "$1"', sys.executable, code]
    try:
        done = subprocess.run(command, check=False, capture_output=True, text=True, timeout=600)
    except FileNotFoundError:
        need("unshare", "util-linux has it")
        raise
    need("namespaces of one's own" if "unshare" in done.stderr else "", "the system has to allow them")
    return done.stdout + done.stderr


def test_no_route_for_multicast_and_the_command_that_adds_one() -> None:
    code = "from dubins_traffic.transports.lcm import connection as c; c.connect(c.DEFAULT_URL); print('connected')"
    said = without_network(code)
    assert "TransportError: no route for LCM's multicast to 239.255.76.67" in said
    command = said.split("this adds one within this machine: ")[1].strip()
    assert command.count("sudo ") == 2
    if shutil.which("ip") is None:
        return
    said = without_network(code, f"ip link set lo up; {command.replace('sudo ', '')}")
    assert said == "connected\n"


def test_names_too_long_for_a_channel() -> None:
    with pytest.raises(InputError, match="too long"):
        connection.command("a" * 60)
