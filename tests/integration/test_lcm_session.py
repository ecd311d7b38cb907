"""`dubins-traffic lcm run` with programs of users: in Python, in C, killed, stopped, flooding."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from select import select
from threading import Event, Thread

import pytest

pytest.importorskip("lcm", reason="LCM's wheel needs libglib2.0-0: scripts/system-packages.sh installs it")

import lcm as library

import dubins_traffic as dt
from tests.beside import running
from tests.conformance.test_lcm import free_url
from tests.conformance.transport import frames
from tests.tools import program

pytestmark = pytest.mark.tools

ROOT = Path(__file__).resolve().parents[2]
COMMAND = str(Path(sys.executable).with_name("dubins-traffic"))
PATIENT = ("--lockstep", "--deadline", "600", "--begin", "600")
"""In lockstep what is not answered is sent again: a lost message ends no trial, a busy machine might."""
PYTHON = [sys.executable, str(ROOT / "examples" / "lcm" / "controller.py")]
UNHURRIED = [
    sys.executable,
    "-c",
    f"""
import runpy, time
from dubins_traffic.transports.lcm.dubins_traffic_lcm import command_t

at_once = command_t.encode

def encode(self):
    time.sleep(0.03)
    return at_once(self)

command_t.encode = encode
runpy.run_path({PYTHON[-1]!r}, run_name="__main__")
""",
]
"""The same, at such a pace that somebody who listens can keep up."""


@pytest.fixture(autouse=True)
def url(monkeypatch: pytest.MonkeyPatch) -> str:
    made = free_url()
    monkeypatch.setenv("LCM_DEFAULT_URL", made)
    return made


def ended(process: subprocess.Popen[str], seconds: float = 600.0) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=seconds)
    return process.returncode, out, err


def lcm_run(*options: str) -> tuple[str, ...]:
    return (COMMAND, "lcm", "run", "demo", "--seed", "1", *options)


@pytest.fixture(scope="module")
def in_c(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The example in C, built with the library that the wheel brings."""
    folder, site = tmp_path_factory.mktemp("c"), Path(library.__file__).parents[1]
    generate = str(Path(sys.executable).with_name("lcm-gen"))
    subprocess.run([COMMAND, "lcm", "messages", "-o", "messages.lcm"], cwd=folder, check=True)
    subprocess.run([generate, "-c", "messages.lcm"], cwd=folder, check=True)
    sources = [str(ROOT / "examples" / "lcm" / "controller.c"), *map(str, folder.glob("*.c"))]
    places = [f"-I{folder}", f"-I{site}/include", f"-L{site}/lib", f"-Wl,-rpath,{site}/lib"]
    compiler = [program("gcc"), "-Wall", "-Wextra", "-Werror", "-Wno-unused-parameter"]
    built = folder / "controller"
    subprocess.run([*compiler, "-o", built, *sources, *places, "-llcm", "-lm"], check=True)
    return str(built)


def test_controllers_in_python_and_c_drive_equal_trials(in_c: str, tmp_path: Path) -> None:
    made: list[list[bytes]] = []
    for name, command, options in (
        ("python", PYTHON, PATIENT),
        ("c", [in_c], (*PATIENT, "--wait")),
    ):
        folder = tmp_path / name
        with running(*command) as peer:
            with running(*lcm_run(*options, "--trials", "2", "--records", str(folder), "--json")) as session:
                status, out, _ = ended(session)
            peer.send_signal(signal.SIGINT)
            assert ended(peer)[0] == 0
        assert status == 0
        assert [score["end"] for score in json.loads(out)["trials"]] == ["duration"] * 2
        made.append([frames(path) for path in sorted(folder.glob("*.mcap"))])
        record = dt.load_record(folder / "trial-0000.mcap")
        assert record.controller == "lcm"
    assert made[0] == made[1]
    assert len(made[0]) == 2


@contextmanager
def losing(one: str, other: str, share: float) -> Iterator[list[str]]:
    """Carry messages between two URLs and lose a share of them each way; yields the channels of those lost."""
    over, chance, lost = Event(), random.Random(1), []
    session, driver = library.LCM(one), library.LCM(other)

    def carry(to: library.LCM, channel: str, data: bytes) -> None:
        if chance.random() < share:
            lost.append(channel)
        else:
            to.publish(channel, data)

    session.subscribe("TRAFFIC_(INSTANCE|STATE_.*|END|GRANT)", partial(carry, driver))
    driver.subscribe("TRAFFIC_(COMMAND_.*|MODE)", partial(carry, session))

    def relay() -> None:
        while not over.is_set():
            for heard in select([session.fileno(), driver.fileno()], [], [], 0.1)[0]:
                (session if heard == session.fileno() else driver).handle_timeout(0)

    thread = Thread(target=relay)
    thread.start()
    try:
        yield lost
    finally:
        over.set()
        thread.join()


def driven(folder: Path, share: float, monkeypatch: pytest.MonkeyPatch) -> tuple[float, list[str]]:
    """Return how long a driver was waited for in two trials of 150 ticks, a share of messages lost, and those lost."""
    folder.mkdir()
    config = folder / "short.json"
    config.write_text(json.dumps(dt.load_config("demo").to_document() | {"duration_bounds": [5, 5]}))
    url, other = free_url(), free_url()
    monkeypatch.setenv("LCM_DEFAULT_URL", other)
    with losing(url, other, share) as lost, running(*PYTHON):
        options = (*PATIENT, "--trials", "2", "--records", str(folder), "--url", url, "--json")
        with running(COMMAND, "lcm", "run", str(config), *options) as session:
            status, out, err = ended(session)
    assert status == 0, err
    assert [trial["end"] for trial in json.loads(out)["trials"]] == ["duration"] * 2
    acts = [json.loads(path.read_text())["act_s"] for path in folder.glob("*.wall.json")]
    assert [act["count"] for act in acts] == [150, 150]
    return sum(act["mean"] * act["count"] for act in acts), lost


def test_lost_messages_cost_little_and_end_no_trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A lost message costs less than half a second, where it cost a whole one, whatever else this machine does."""
    quiet, none = driven(tmp_path / "quiet", 0.0, monkeypatch)
    lossy, lost = driven(tmp_path / "lossy", 0.1, monkeypatch)
    assert none == []
    states, commands = lost.count("TRAFFIC_STATE_ego"), lost.count("TRAFFIC_COMMAND_ego")
    assert min(states, commands) > 10
    assert lossy < 3.0 * quiet + 0.5 * (states + commands)


def test_an_ego_elsewhere_drives_under_the_shield(tmp_path: Path) -> None:
    with running(*PYTHON) as peer:
        options = ("--trials", "1", "--records", str(tmp_path), "--shield", "--json")
        with running(*lcm_run(*PATIENT, *options)) as session:
            status, out, _ = ended(session)
        peer.send_signal(signal.SIGINT)
        ended(peer)
    (score,) = json.loads(out)["trials"]
    assert (status, score["end"], score["controller"]) == (0, "duration", "lcm+shield")
    assert score["interventions"] > 0
    assert score["off_road_s"] == 0.0
    record = dt.load_record(tmp_path / "trial-0000.mcap")
    assert sum(event.kind == "shield" for event in record.frames.events) == score["interventions"]


@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP])
def test_a_controller_killed_or_stopped_ends_its_trial_only(fault: signal.Signals) -> None:
    with (
        running(*PYTHON) as peer,
        running(*lcm_run("--silence", "0.7", "--trials", "1", "--json")) as session,
    ):
        wait_for_commands()
        peer.send_signal(fault)
        status, out, err = ended(session)
    assert status == 1
    assert "peer_silent: no command for 0.7 s" in err
    assert json.loads(out)["trials"][0]["end"] == "peer_silent"


def wait_for_commands() -> None:
    """Return when the ego is being driven."""
    ears = library.LCM(os.environ["LCM_DEFAULT_URL"])
    heard: list[str] = []
    ears.subscribe("TRAFFIC_COMMAND_ego", lambda channel, _: heard.append(channel))
    until = time.monotonic() + 600
    while not heard and time.monotonic() < until:
        ears.handle_timeout(200)
    assert heard


def test_a_flood_at_ten_kilohertz() -> None:
    with running(*PYTHON), running(*lcm_run("--trials", "1")) as session:
        wait_for_commands()
        mouth, heard = library.LCM(os.environ["LCM_DEFAULT_URL"]), []
        mouth.subscribe("TRAFFIC_COMMAND_ego", lambda _, data: heard.append(data))
        while not heard:
            mouth.handle_timeout(200)
        until = time.monotonic() + 600
        while session.poll() is None and time.monotonic() < until:
            for _ in range(10):
                mouth.publish("TRAFFIC_COMMAND_ego", heard[0])
            time.sleep(0.001)
        status, _, err = ended(session)
    assert status == 1
    assert "peer_flood" in err


def test_a_second_session_and_an_interrupted_one() -> None:
    with running(*lcm_run("--wait")) as first:
        ears, heard = library.LCM(os.environ["LCM_DEFAULT_URL"]), []
        ears.subscribe("TRAFFIC_WORLD", lambda channel, _: heard.append(channel))
        while not heard:
            assert ears.handle_timeout(600_000) > 0
        with running(*lcm_run("--wait")) as second:
            status, _, err = ended(second)
        assert status == 2
        assert "another session is running" in err
        first.send_signal(signal.SIGINT)
        status, _, err = ended(first)
    assert status == 1
    assert "interrupted after 0 trials" in err


def logged(folder: Path) -> tuple[Path, list[Path]]:
    """Run two sessions of one and two trials beside lcm-logger; return the log and the records."""
    logger = str(Path(library.__file__).parents[1] / "bin" / "lcm-logger")
    log, config = folder / "trial.log", folder / "short.json"
    config.write_text(json.dumps(dt.load_config("demo").to_document() | {"duration_bounds": [2, 2]}))
    url = os.environ["LCM_DEFAULT_URL"]
    with running(logger, "-l", url, "--quiet", str(log)) as logging, running(*UNHURRIED):
        until_logged("BEFORE", log)
        for trials in ("1", "2"):
            options = (*PATIENT, "--trials", trials, "--records", str(folder / trials))
            with running(COMMAND, "lcm", "run", str(config), "--seed", trials, *options) as session:
                assert ended(session)[0] == 0
        until_logged("AFTER", log)
        logging.send_signal(signal.SIGINT)
        logging.wait(600)
    return log, sorted(folder.glob("?/*.mcap"))


def until_logged(channel: str, log: Path) -> None:
    """Say something on a channel until lcm-logger has written it; what was sent before has reached it by then."""
    mouth, until = library.LCM(os.environ["LCM_DEFAULT_URL"]), time.monotonic() + 600
    while not log.exists() or channel.encode() not in log.read_bytes():
        assert time.monotonic() < until
        mouth.publish(channel, b"")
        time.sleep(0.05)


def converted(folder: Path, made: Path, tries: int = 6) -> tuple[Path, list[Path]]:
    """Log and convert trials.

    LCM keeps 30 messages for a logger that gets no processor, and drops the others: the log is refused then.
    """
    own = folder / f"try-{tries}"
    own.mkdir()
    log, records = logged(own)
    done = subprocess.run([COMMAND, "convert", str(log), "-o", str(made)], check=False, capture_output=True)
    if done.returncode == 0 or tries == 1:
        assert done.returncode == 0
        return log, records
    assert b"frames are missing" in done.stderr
    return converted(folder, made, tries - 1)


def test_a_log_becomes_the_records_of_its_trials(tmp_path: Path) -> None:
    first = tmp_path / "made.mcap"
    log, records = converted(tmp_path, first)
    made = [first, tmp_path / "made-1.mcap", tmp_path / "made-2.mcap"]
    assert sorted(tmp_path.glob("made*.mcap")) == sorted(made)
    assert [frames(path) for path in made] == [frames(path) for path in records]
    there, here = dt.load_record(made[2]), dt.load_record(records[2])
    for column in ("segment", "at", "crosses", "lane", "bits", "command_speed", "command_yaw_rate"):
        assert getattr(there.frames, column).tolist() == getattr(here.frames, column).tolist(), column
    assert there.ending == here.ending
    assert there.instance.problem == here.instance.problem
    (tmp_path / "cut.log").write_bytes(log.read_bytes()[:200])
    done = subprocess.run(
        [COMMAND, "convert", tmp_path / "cut.log", "-o", tmp_path / "cut.mcap"],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "cut.log" in done.stderr


def test_the_messages_can_be_had(tmp_path: Path) -> None:
    file = tmp_path / "messages.lcm"
    subprocess.run([COMMAND, "lcm", "messages", "-o", file], check=True)
    shipped = ROOT / "src/dubins_traffic/transports/lcm/dubins_traffic_lcm.lcm"
    assert file.read_text() == shipped.read_text()
    assert shutil.which("lcm-gen", path=str(Path(sys.executable).parent)) is not None
