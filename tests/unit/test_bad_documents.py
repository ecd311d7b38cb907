"""Every wrong document is refused with one message that names file, field, value and expectation."""

import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import load_instance
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.files import FileKind, detect
from dubins_traffic.problem.trial_data import TrialData

Document = dict[str, Any]
WANDER = {"type": "wander", "name": "agent"}


def base(**changes: Any) -> Document:
    """Return a good configuration of version 1 with top-level changes; ... takes a key away."""
    document: Document = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4]},
        "e-agents": [{"type": "wander/wander", "name": "agent0"}],
        "number_trials": 1,
    }
    for key, value in changes.items():
        name = key.replace("e_agents", "e-agents")
        document[name] = value
        if value is ...:
            del document[name]
    return document


def instance(**changes: Any) -> Document:
    document: Document = {
        "version": 1,
        "goals": [[2, 0]],
        "rnd": {"version": 0, "length": 3, "transform": [0, 0, 0], "shape": [3, 4]},
        "intersection_radius": 1,
        "duration": 60,
        "seed": 4,
        "trial": 0,
        "starts": {"ego": [0, 0, 1, 0]},
    }
    document.update(changes)
    return {key: value for key, value in document.items() if value is not ...}


def obstacle(*corners: list[float]) -> list[Document]:
    return [{"polygon": {"vertices": list(corners)}}]


def trial_data(**changes: Any) -> Document:
    return {
        "version": 0,
        "date": "2016-05-16 09:00:00",
        "trialconf": base(version=0),
        "instances": [],
    } | changes


# name, document, field, value as shown (None: nothing to show), a part of the expectation
CONFIGURATIONS: list[tuple[str, Document, str, str | None, str]] = [
    ("no version", base(version=...), "version", None, "0 or 1"),
    ("version of tomorrow", base(version=7), "version", "7", "0 or 1"),
    ("version true", base(version=True), "version", "True", "0 or 1"),
    ("version as text", base(version="0"), "version", "'0'", "0 or 1"),
    ("another domain", base(problem_domain="integrator_chains"), "problem_domain", "'integrator_chains'", "dubins"),
    ("no domain", base(problem_domain=..., version=0), "problem_domain", None, "dubins_traffic"),
    ("no network", base(rnd=..., version=0), "rnd", None, "road network description"),
    ("neither rnd nor network", base(rnd=...), "rnd", "None", "either rnd or network"),
    ("rnd and network", base(network={"grid": {"rows": 2, "columns": 2}}), "rnd", "{", "either rnd or network"),
    ("rnd is a number", base(rnd=3), "rnd", "3", "an object"),
    ("rnd is no file", base(rnd="nowhere.json"), "rnd", "'nowhere.json'", "beside the configuration"),
    ("negative length", base(rnd={"version": 0, "length": -3, "shape": [2, 2]}), "rnd.length", "-3", "a number"),
    ("huge length", base(rnd={"version": 0, "length": 1e300, "shape": [2, 2]}), "rnd.length", "1e+300", "a number"),
    ("NaN", base(rnd={"version": 0, "length": float("nan"), "shape": [2, 2]}), "rnd.length", "nan", "finite"),
    ("infinite rate", base(rate=float("inf")), "rate", "inf", "finite"),
    ("trials as text", base(number_trials="3"), "number_trials", "'3'", "an integer"),
    ("trials true", base(number_trials=True), "number_trials", "True", "an integer"),
    ("trials with a fraction", base(number_trials=1.0), "number_trials", "1.0", "an integer"),
    ("no trials", base(number_trials=0), "number_trials", "0", ">= 1"),
    ("too many trials", base(number_trials=10**30), "number_trials", "1000000", "<= 4294967295"),
    ("bounds in the wrong order", base(duration_bounds=[9, 5]), "duration_bounds", "[9, 5]", "low <= high"),
    ("three bounds", base(duration_bounds=[5, 6, 7]), "duration_bounds", "[5, 6, 7]", "at most 2"),
    ("duration with a fraction", base(duration_bounds=[5.5, 6]), "duration_bounds[0]", "5.5", "an integer"),
    ("goals below zero", base(number_goals_bounds=[-1, 2]), "number_goals_bounds[0]", "-1", ">= 0"),
    ("goal off the network", base(goals=[[0, 0], [9, 9]]), "goals[1]", "[9, 9]", "an intersection"),
    ("goal of three numbers", base(goals=[[0, 0, 1]]), "goals[0]", "[0, 0, 1]", "at most 2"),
    ("negative duration", base(duration=-1), "duration", "-1", "> 0"),
    ("endless duration", base(duration=1e300), "duration", "1e+300", "<= 10000000"),
    ("too many ticks", base(duration=1e7, rate=1e5), "duration", "10000000.0", "2147483647 ticks"),
    ("no tick", base(duration=1e-3), "duration", "0.001", "between 1 and"),
    ("e-agents is an object", base(e_agents={}), "e-agents", "{}", "a list"),
    ("unknown agent", base(e_agents=[{"type": "chase", "name": "a"}]), "e-agents[0].type", "'chase'", "wander"),
    ("agent without type", base(e_agents=[{"name": "a"}]), "e-agents[0].type", None, "wander"),
    ("agent without name", base(version=0, e_agents=[{"type": "wander"}]), "e-agents[0].name", None, "its name"),
    ("agent called ego", base(e_agents=[{"type": "wander", "name": "ego"}]), "e-agents[0].name", "'ego'", "own"),
    ("name twice", base(e_agents=[{"type": "wander", "name": "a"}] * 2), "e-agents[1].name", "'a'", "own"),
    ("name with blanks", base(e_agents=[{"type": "wander", "name": "a b"}]), "e-agents[0].name", "'a b'", "match"),
    ("negative count", base(e_agents=[WANDER | {"count": -1}]), "e-agents[0].count", "-1", ">= 0"),
    ("a billion agents", base(e_agents=[WANDER | {"count": 10**9}]), "e-agents[0].count", "1000000000", "<= 10000"),
    ("counts add up", base(e_agents=[WANDER | {"count": 9000}] * 2), "e-agents", "18000", "at most 10000"),
    (
        "one start for many",
        base(e_agents=[WANDER | {"count": 3, "start": [1, 0, 0]}]),
        "e-agents[0].count",
        "3",
        "left out",
    ),
    (
        "unknown parameter",
        base(e_agents=[WANDER | {"parameters": {"sped": 1}}]),
        "e-agents[0].parameters.sped",
        "1",
        "speed",
    ),
    (
        "parameter out of range",
        base(e_agents=[WANDER | {"parameters": {"speed": -1}}]),
        "e-agents[0].parameters.speed",
        "-1",
        ">= 1e-06",
    ),
    (
        "script without commands",
        base(e_agents=[{"type": "scripted", "name": "a"}]),
        "e-agents[0].parameters.commands",
        None,
        "a list",
    ),
    (
        "cycle that jumps",
        base(e_agents=[{"type": "loop", "name": "a", "parameters": {"cycle": [[0, 0], [2, 0]]}}]),
        "e-agents[0].parameters.cycle[0]",
        "[0, 0]",
        "joined",
    ),
    ("misspelt key", base(sensing_raduis=3), "sensing_raduis", "3", "sensing_radius"),
    ("misspelt key of an agent", base(e_agents=[WANDER | {"cuont": 3}]), "e-agents[0].cuont", "3", "count"),
    (
        "parameter of an agent beside its type",
        base(e_agents=[WANDER | {"speed": 0.3}]), "e-agents[0].speed", "0.3", "in parameters",
    ),
    ("unknown key of the car", base(car={"weight": 3}), "car.weight", "3", "one of w, body, bounds"),
    ("misspelt key of the car", base(car={"bound": 3}), "car.bound", "3", "bounds, or one of w, body"),
    ("car without width", base(car={"w": 0}), "car.w", "0", ">= 0.001"),
    ("two bodies", base(car={"body": {"disc": {}, "rectangle": {"length": 1, "width": 1}}}), "car.body", "{", "either"),
    ("no rectangle width", base(car={"body": {"rectangle": {"length": 1}}}), "car.body.rectangle.width", None, "m"),
    ("least above largest speed", base(car={"bounds": {"speed_min": 1}}), "car.bounds.speed_min", "1", "<= 0.7"),
    ("rate too low", base(rate=6), "rate", "6", ">= 6.283"),
    ("blind", base(sensing_radius=0), "sensing_radius", "0", ">= 1e-06"),
    ("laser without rays", base(laser={"rays": 0}), "laser.rays", "0", ">= 1"),
    ("laser all round and on", base(laser={"angle_max": 9}), "laser.angle_max", "9", "2 pi"),
    ("obstacle without radius", base(obstacles=[{"disc": {"x": 0, "y": 0}}]), "obstacles[0].disc.radius", None, "m"),
    ("two corners", base(obstacles=obstacle([0, 0], [1, 1])), "obstacles[0].polygon.vertices", "[[", "at least 3"),
    ("bow tie", base(obstacles=obstacle([0, 0], [1, 1], [1, 0], [0, 1])), "obstacles[0].polygon", "{", "simple"),
    ("noise below zero", base(disturbances={"position_noise": -1}), "disturbances.position_noise", "-1", ">= 0"),
    ("loss above one", base(disturbances={"command_loss": 2}), "disturbances.command_loss", "2", "<= 1"),
    ("ends on what", base(end_on_collision=1), "end_on_collision", "1", "true or false"),
    ("unknown rule", base(rules={"speed_limit": 1}), "rules.speed_limit", "1", "still_speed"),
    ("rule of the wrong type", base(rules={"tickets": 1.5}), "rules.tickets", "1.5", "an integer"),
    ("rules on short roads", base(rules=True, intersection_radius=1.2), "rnd.segments[0]", "3.0", "at least 3.254"),
    ("rules without sight", base(rules=True, sensing_radius=2), "sensing_radius", "2.0", "at least 3.354"),
    ("rules with small discs", base(rules=True, intersection_radius=0.5), "intersection_radius", "0.5", "2.9 w = 0.87"),
    ("start of two numbers", base(ego={"start": [0, 0]}), "ego.start", "[0, 0]", "[x, y, theta]"),
    ("start far away", base(ego={"start": [0, 1e300, 0]}), "ego.start", "1e+300", "none above"),
    (
        "starts that overlap",
        base(ego={"start": [0, 0, 0]}, e_agents=[WANDER | {"start": [0.3, 0, 0]}]),
        "e-agents[0].start",
        "[0.3, 0.0, 0.0]",
        "clear",
    ),
    (
        "start in an obstacle",
        base(ego={"start": [1, 0, 0]}, obstacles=obstacle([0, -1], [2, -1], [2, 1], [0, 1])),
        "ego.start",
        "[1.0, 0.0, 0.0]",
        "clear",
    ),
    ("too many cars", base(e_agents=[WANDER | {"count": 500}]), "e-agents", "500", "at most"),
    ("impossible network", base(rnd=..., network={"random": {"intersections": 9, "segments": 13}}),
     "network.random.segments", "13", "between 8 and 12"),
    ("huge grid", base(rnd=..., network={"grid": {"rows": 10**4, "columns": 10**4}}), "network.grid", "{", "100000"),
    ("no such network", base(rnd=..., network={}), "network", "{}", "one of random, grid and file"),
    ("a path as network", base(rnd=..., network="a.xodr"), "network", "a.xodr", '{"file": "a.xodr"}, or the path'),
    ("network is no file", base(rnd=..., network={"file": "no.net.xml"}), "network.file", "no.net.xml", "beside"),
    ("rnd is a number", base(rnd=3), "rnd", "3", "the path of one or of a map of another program"),
]  # fmt: skip

INSTANCES: list[tuple[str, Document, str, str | None, str]] = [
    ("instance of tomorrow", instance(version=2), "version", "2", "0 or 1"),
    ("no goals", instance(goals=...), "goals", None, "lattice points"),
    ("goal off the network", instance(goals=[[0, 0], [4, 0]]), "goals[1]", "[4, 0]", "an intersection"),
    ("path as network", instance(rnd="square.json"), "rnd", "'square.json'", "an object"),
    ("crossing roads", instance(rnd={"version": 0, "length": 1, "segments": [[0, 0, 1, 1], [1, 0, 0, 1]]}),
     "rnd.segments[", "[", "common"),
    ("no radius", instance(intersection_radius=0), "intersection_radius", "0", ">= 1e-06"),
    ("negative seed", instance(seed=-1), "seed", "-1", ">= 0"),
    ("seed of 65 bits", instance(seed=2**64), "seed", "18446744073709551616", "< 18446744073709551616"),
    ("start of nobody", instance(starts={"bob": [0, 0, 1, 0]}), "starts", "'bob'", "ego"),
    ("heading too long", instance(starts={"ego": [0, 0, 1, 1]}), "starts.ego", "[0, 0, 1, 1]", "length 1"),
    ("start as text", instance(starts={"ego": "here"}), "starts.ego", "'here'", "[x, y, theta]"),
]  # fmt: skip

TRIAL_DATA: list[tuple[str, Document, str, str | None, str]] = [
    ("date of another style", trial_data(date="May 16"), "date", "'May 16'", "match"),
    (
        "no instances",
        {k: v for k, v in trial_data().items() if k != "instances"},
        "instances",
        None,
        "instances",
    ),
    (
        "bad instance",
        trial_data(instances=[instance(goals=[[8, 8]])]),
        "instances[0].goals[0]",
        "[8, 8]",
        "inter",
    ),
    ("bad configuration", trial_data(trialconf=base(rate=-1)), "trialconf.rate", "-1", "> 0"),
]


def refused(tmp_path: Path, document: Document, read: Callable[[str], object]) -> str:
    file = tmp_path / "bad.json"
    file.write_text(json.dumps(document))
    start = time.process_time()
    with pytest.raises(InputError) as caught:
        read(str(file))
    assert time.process_time() - start < 2.0
    message = str(caught.value)
    assert message.startswith(f"{file}: ")
    assert "\n" not in message
    return message.removeprefix(f"{file}: ")


def check(message: str, field: str, value: str | None, expected: str) -> None:
    assert message.startswith(field)
    found, _, wanted = message.partition("; expected ")
    assert expected in wanted
    if value is None:
        assert ": missing" in found
    else:
        assert value in found.partition(": got ")[2]


@pytest.mark.parametrize(
    ("document", "field", "value", "expected"), [pytest.param(*c[1:], id=c[0]) for c in CONFIGURATIONS]
)
def test_a_bad_configuration_is_refused(
    tmp_path: Path, document: Document, field: str, value: str | None, expected: str
) -> None:
    check(refused(tmp_path, document, lambda file: draw(load_config(file))), field, value, expected)


@pytest.mark.parametrize(("document", "field", "value", "expected"), [pytest.param(*c[1:], id=c[0]) for c in INSTANCES])
def test_a_bad_instance_is_refused(
    tmp_path: Path, document: Document, field: str, value: str | None, expected: str
) -> None:
    check(refused(tmp_path, document, load_instance), field, value, expected)


@pytest.mark.parametrize(
    ("document", "field", "value", "expected"), [pytest.param(*c[1:], id=c[0]) for c in TRIAL_DATA]
)
def test_bad_trial_data_is_refused(
    tmp_path: Path, document: Document, field: str, value: str | None, expected: str
) -> None:
    check(refused(tmp_path, document, TrialData.read), field, value, expected)


def test_the_first_of_several_faults_is_told_and_the_others_are_counted(tmp_path: Path) -> None:
    message = refused(tmp_path, base(rate="x", sensing_radius=-1, number_trials=0), load_config)
    assert "(and 2 more faults)" in message


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("", "not JSON"),
        ("{", "line 1"),
        ("[1, 2]", "a JSON object"),
        ('{"version": 0, "version": 1}', "version: key stands twice"),
        ('{"version": NaN}', "version: not a finite number"),
        ('{"version": 1e999}', "version: not a finite number: got inf"),
        ('{"version": ' + "9" * 5000 + "}", "too many digits"),
        ('{"a": ' + "[" * 200 + "]" * 200 + "}", "nested too deep"),
        ("[" * 100_000, "nested too deep"),
    ],
)
def test_what_is_no_json_object_is_refused(tmp_path: Path, text: str, part: str) -> None:
    file = tmp_path / "bad.json"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        load_config(file)
    assert str(caught.value).startswith(str(file))
    assert part in str(caught.value)


def test_what_can_not_be_read_is_refused(tmp_path: Path) -> None:
    binary = tmp_path / "binary.json"
    binary.write_bytes(b"\xff\xfe\x00")
    record = tmp_path / "record.mcap"
    record.write_bytes(b"\x89MCAP0\r\n")
    for path in (tmp_path, tmp_path / "none.json", binary, record):
        with pytest.raises(InputError, match=str(path)):
            load_config(path)


def test_an_unknown_name_lists_the_shipped_configurations() -> None:
    with pytest.raises(InputError, match=r"no-such-thing.*mc-small-4grid-agents2"):
        load_config("no-such-thing")


def test_the_wrong_kind_of_document_is_named(tmp_path: Path) -> None:
    for document, read, kind in (
        (instance(), load_config, "a problem instance|a instance|instance"),
        (base(), load_instance, "configuration"),
        (base(), TrialData.read, "configuration"),
        ({"version": 0, "length": 1, "shape": [2, 2]}, load_config, "network"),
        ({"colour": "red"}, load_config, "unknown kind"),
    ):
        with pytest.raises(InputError, match=kind):
            read(_written(tmp_path, document))


def _written(folder: Path, document: Document) -> Path:
    path = folder / "some.json"
    path.write_text(json.dumps(document))
    return path


@pytest.mark.parametrize(
    ("document", "kind"),
    [
        ({"version": 0, "length": 1, "transform": [0, 0, 0], "shape": [2, 2]}, FileKind.NETWORK),
        ({"version": 0, "segments": [[0, 0, 0, 1]], "length": 1}, FileKind.NETWORK),
        (base(version=0), FileKind.CONFIGURATION),
        (base(), FileKind.CONFIGURATION),
        ({"version": 0, "e-agents": [], "rnd": {}}, FileKind.CONFIGURATION),
        ({"version": 0, "goals": [], "rnd": {}, "intersection_radius": 1}, FileKind.INSTANCE),
        (instance(), FileKind.INSTANCE),
        (instance(**{"e-agents": []}), FileKind.INSTANCE),
        (trial_data(), FileKind.TRIAL_DATA),
    ],
)
def test_documents_are_told_apart_by_content(document: Document, kind: FileKind) -> None:
    assert detect(document) is kind
