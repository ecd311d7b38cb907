"""Searches, shrinking and regression of programs elsewhere, in boxes, and on a Ray cluster."""

from __future__ import annotations

import json
import re
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import dubins_traffic as dt
from dubins_traffic.cli.main import main
from dubins_traffic.controllers.registry import load
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.archive import files
from dubins_traffic.falsification.case import judge, read_case
from dubins_traffic.falsification.regress import regress
from dubins_traffic.falsification.remote import Remote
from dubins_traffic.transports.lines_client import drive
from tests.boxes import needs_boxes, written
from tests.ros import Graph, finish, graph, need_ros
from tests.tools import need_module

UNHURRIED = "deadline=600,begin=600"
ASKED = {"trials": 8, "seed": 3, "duration": 6.0, "rules": ["3.stop", "1.road"]}
PROGRAM = """
import json, sys
from dubins_traffic.controllers.registry import load
from dubins_traffic.problem.public_problem import problem_from_document
from dubins_traffic.transports.line_messages import observation_from_document

for line in sys.stdin:
    message = json.loads(line)
    if "problem" in message:
        problem, driver = problem_from_document(message["problem"]), load("simple")
        driver.start(problem)
    elif "frame" in message:
        speed, yaw_rate = driver.act(observation_from_document(message["frame"], problem))
        print(json.dumps({"command": [speed, yaw_rate], "tick": message["frame"]["tick"]}), flush=True)
"""


def tee() -> dict[str, object]:
    """Return a junction of three roads with one other car: a box is made anew for all that shrinking takes away."""
    document = dt.load_config("junction").to_document()
    roads = {**document["rnd"], "shape": [2, 3], "segments": document["rnd"]["segments"][:3]}
    return {**document, "rnd": roads, "e-agents": [{"type": "lawful", "name": "car"}]}


def found_here(folder: Path) -> dict[str, str]:
    """Return what a search of `simple` finds in this process: the text of each instance, by the name of its cell."""
    dt.falsify("junction", "simple", folder, **ASKED)
    return known(folder)


def known(folder: Path) -> dict[str, str]:
    cases = {path.stem: read_case(path) for path in files(folder)}
    return {
        name: json.dumps([case.story.rule, case.story.tick, case.story.sentence, str(case.instance.starts)])
        for name, case in cases.items()
    }


@contextmanager
def driving(once: Callable[[], object]) -> Iterator[None]:
    """Let a thread drive trial after trial, whenever there is one."""
    over = threading.Event()

    def drive_on() -> None:
        while not over.is_set():
            try:
                once()
            except (OSError, EOFError):
                over.wait(0.05)

    thread = threading.Thread(target=drive_on, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(timeout=600)


def test_a_program_on_a_socket_is_searched_shrunk_and_run_again_as_if_it_were_here(tmp_path: Path) -> None:
    said: list[str] = []
    with Remote(f"lines,{UNHURRIED}", say=said.append) as driver:

        def once() -> None:
            at = [re.search(r"JSON lines at 127.0.0.1:(\d+)", line) for line in said]
            ports = [int(own[1]) for own in at if own]
            if not ports:
                raise OSError("not there yet")
            drive(("127.0.0.1", ports[0]), load("simple"))

        with driving(once):
            dt.falsify("junction", driver, tmp_path / "there", **ASKED)
            assert known(tmp_path / "there") == found_here(tmp_path / "here")
            case = next(path for path in files(tmp_path / "there") if path.name.startswith("3.stop"))
            assert read_case(case).story.controller == "lines"
            small = dt.shrink(case, driver)
            assert len(small.instance.e_agents) == 0
            assert judge(small.instance, driver, "lines").breach("3.stop") is not None
            assert not any(own.passed for own in regress(tmp_path / "there", driver))
            driver.close()


def test_commands_reach_a_program_elsewhere(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script, crossing = tmp_path / "drive.py", tmp_path / "crossing.json"
    script.write_text(PROGRAM)
    one = {"type": "lawful", "name": "car"}  # the program is begun anew for all that shrinking takes away
    crossing.write_text(json.dumps({**dt.load_config("junction").to_document(), "e-agents": [one]}))
    over = ["--over", f"stdio,program={sys.executable} {script},{UNHURRIED}"]
    options = ["--rule", "3.stop", "--trials", "2", "--duration", "6", "--seed", "6"]
    assert main(["falsify", str(crossing), *over, *options, "-o", str(tmp_path / "found")]) == 0
    case = next(files(tmp_path / "found"))
    assert main(["regress", str(tmp_path / "found"), *over]) == 1
    assert main(["shrink", str(case), *over, "-o", str(tmp_path / "small.json")]) == 0
    assert "without having stopped at its line" in capsys.readouterr().out
    assert "<html" in (tmp_path / "small.html").read_text()
    assert read_case(tmp_path / "small.json").story.controller == "stdio"


@pytest.mark.parametrize(
    ("over", "words"),
    [
        ("pigeon", "no such transport: got 'pigeon'"),
        ("lines,speed=3", "no such option: got 'speed=3'; expected of lines: port, deadline, begin, silence"),
        ("lines,port=many", "not a number: got 'port=many'; expected 0 to 65535"),
        ("ros1,master=1", "takes no value: got 'master=1'; expected master"),
        ("lines,begin=soon", "not seconds: got 'begin=soon'"),
    ],
)
def test_a_way_that_there_is_not_is_refused(
    over: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["falsify", "junction", "--over", over, "-o", str(tmp_path / "found")]) == 2
    assert f"--over: {words}" in capsys.readouterr().err
    assert not (tmp_path / "found").exists()


def test_a_program_elsewhere_drives_one_trial_at_a_time(tmp_path: Path) -> None:
    with Remote("lines") as driver, pytest.raises(InputError, match="given by name, not one elsewhere"):
        dt.falsify("junction", driver, tmp_path / "found", trials=4, workers=2)


@pytest.mark.tools
def test_a_program_over_lcm_is_searched(tmp_path: Path) -> None:
    need_module("lcm")
    from dubins_traffic.transports.lcm.client import Driver
    from tests.conformance.test_lcm import free_url

    url = free_url()
    peer = Driver(load("simple"), url)

    def once() -> None:
        try:
            peer.drive(patience=1.0)
        except TimeoutError:
            raise EOFError from None

    with Remote(f"lcm,url={url},{UNHURRIED}") as driver, driving(once):
        dt.falsify("junction", driver, tmp_path / "there", **ASKED)
    assert known(tmp_path / "there") == found_here(tmp_path / "here")


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Graph]:
    need_ros()
    with graph(tmp_path) as made:
        yield made


@pytest.mark.tools
def test_a_node_over_ros_is_searched_and_its_cases_run_again(ros: Graph, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dubins_traffic.cli"]
    over = ["--over", f"ros1,{UNHURRIED}"]
    options = ["--rule", "1.road", "--trials", "4", "--duration", "8", "-o", tmp_path / "found"]
    client = ros.client(*["drive"] * 40)
    status, _, told = finish(ros.start([*command, "falsify", "junction", *over, *options]))
    assert status == 0, told
    cases = list(files(tmp_path / "found"))
    assert {read_case(case).story.rule for case in cases} == {"1.road"}
    assert {read_case(case).story.controller for case in cases} == {"ros1"}
    client.kill()  # in the middle of a trial that there is not: the session has ended
    ros.client(*["drive"] * 40)
    status, out, told = finish(ros.start([*command, "regress", tmp_path / "found", *over]))
    assert (status, "left the road near" in out) == (1, True), told


@needs_boxes
def test_a_controller_in_a_box_is_searched_shrunk_and_run_again(tmp_path: Path) -> None:
    spec = written(tmp_path, "return 0.5, 0.0") + "+sandbox"
    searched = document_of(tee())
    found = dt.falsify(searched, spec, tmp_path / "found", trials=10, duration=6.0, rules=["1.road"])
    assert found.violated
    case = next(iter(files(tmp_path / "found")))
    assert read_case(case).story.controller == spec
    assert len(dt.shrink(case).instance.e_agents) == 0
    assert not any(own.passed for own in regress(tmp_path / "found", spec))


@pytest.mark.tools
def test_a_search_on_ray_leaves_the_bytes_of_one_here(tmp_path: Path) -> None:
    need_module("ray")
    asked = {"trials": 48, "seed": 1, "duration": 6.0}
    dt.falsify("junction", "simple", tmp_path / "here", **asked)
    dt.falsify("junction", "simple", tmp_path / "there", **asked, ray="local", workers=2)
    here, there = (
        {path.name: path.read_bytes() for path in sorted((tmp_path / name).rglob("*.json"))}
        for name in ("here", "there")
    )
    assert here == there
    assert len(here) > 3


def test_cars_that_are_nudged_are_searched_and_their_noise_replays(tmp_path: Path) -> None:
    document = dt.load_config("junction").to_document()
    nudged = {"type": "nudged", "name": "car", "count": 2, "parameters": {"delay": 4, "speed_noise": 0.3}}
    document |= {"e-agents": [nudged, {"type": "lawful", "name": "other"}], "rules": {"assume_e1": 0}}
    found = dt.falsify(document_of(document), "lanes", tmp_path / "found", trials=64, seed=2, duration=10.0)
    assert found.violated
    assert found.trials > found.discarded
    for case in found.cases.values():
        assert [agent.kind for agent in case.instance.e_agents] == ["nudged", "nudged", "chosen"]
        judged = judge(case.instance, lambda: load("lanes"), "lanes")
        assert judged.score.verdict is not None
        assert not judged.score.verdict.assumption_broken
        breach = judged.breach(case.story.rule)
        assert breach is not None
        assert breach.tick == case.story.tick


def document_of(document: dict[str, object]) -> dt.Configuration:
    return dt.Configuration.from_document(document)
