"""Trials configurations and instances of version 0 and 1: what they mean, what is kept, where networks are found."""

import hashlib
import json
import pickle
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from jsonschema.exceptions import ValidationError
from scripts.schemas import MAKE, place, schemas, shipped, text

import dubins_traffic as dt
from dubins_traffic.cars.body import Bounds, Car, Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Pose
from dubins_traffic.errors import InputError
from dubins_traffic.falsification.sampling import prepared
from dubins_traffic.problem.configuration import Configuration, load_config, shipped_names
from dubins_traffic.problem.document import instance_from_document, instance_to_document, load_instance
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.files import dumps, write_document
from dubins_traffic.problem.kinds import KINDS, kind_of, parameters_of
from dubins_traffic.problem.parts import Laser
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.roads.network import RoadNetwork
from tests.unit import test_bad_documents as bad

GOLDEN = Path(__file__).parents[1] / "golden" / "data"
SQUARE = {"version": 0, "length": 5, "transform": [0, 0, 0], "shape": [2, 2]}


def test_the_shipped_configuration_of_2016_is_the_original() -> None:
    shipped = Path(sys.modules["dubins_traffic.problem"].__path__[0]) / "configurations"
    data = (shipped / "mc-small-4grid-agents2.json").read_bytes()
    assert hashlib.sha256(data).hexdigest() == "91d8c6db8e69f7a0c60525a83acb038305ebaa41ba4dcd38cbcb5a254a6409e0"
    assert data == (GOLDEN / "mc-small-4grid-agents2.json").read_bytes()


def test_demo_is_the_same_with_three_trials_of_a_minute() -> None:
    original = load_config("mc-small-4grid-agents2").to_document()
    assert load_config("demo").to_document() == original | {"number_trials": 3, "duration_bounds": [60, 60]}
    assert {"demo", "mc-small-4grid-agents2", "town", "wanderers"} <= set(shipped_names())


@pytest.mark.parametrize("name", shipped_names())
def test_a_configuration_writes_back_to_the_same_value(name: str, tmp_path: Path) -> None:
    config = load_config(name)
    write_document(config.to_document(), tmp_path / "again.json")
    again = load_config(tmp_path / "again.json")
    assert again.to_document() == config.to_document()
    assert again.settings == config.settings


def test_defaults_of_2016_hold_and_unknown_keys_are_kept() -> None:
    document = {
        "version": 0,
        "problem_domain": "dubins_traffic",
        "rnd": SQUARE | {"author": "x"},
        "e-agents": [{"type": "wander/wander", "name": "a", "colour": "red"}],
        "car": "not ours in version 0",
        "x": {"y": [1, 2.5, None, True]},
    }
    config = load_config(document)
    assert config.to_document() == document
    assert json.dumps(config.to_document()) == json.dumps(document)
    settings = config.settings
    assert (settings.duration_bounds, settings.number_goals_bounds) == ([30, 90], [1, 4])
    assert config.number_trials == 1
    assert config.car == Car()
    assert (settings.rate, settings.sensing_radius, settings.radius) == (30.0, 5.0, 1.0)
    assert settings.laser is None
    assert settings.rule_parameters == {}
    assert [plan.agent.kind for plan in config.agents] == ["wander"]
    assert [plan.agent.type for plan in config.agents] == ["wander/wander"]


def test_version_1_says_more() -> None:
    document = bad.base(
        car={"w": 0.6, "body": {"rectangle": {"length": 1, "width": 0.5}}, "bounds": {"speed_min": 0.2}},
        laser=True,
        rate=50,
        obstacles=[
            {"disc": {"x": 1, "y": 2, "radius": 3}},
            {"polygon": {"vertices": [[0, 0], [1, 0], [1, 1], [0.5, 0.2]]}},
        ],
        rules={"tickets": 3},
        rnd={"version": 0, "length": 9, "shape": [3, 4]},
        sensing_radius=9,
        note="kept",
    )
    config = load_config(document)
    assert config.car == Car(0.6, Rectangle(1.0, 0.5), Bounds(speed_min=0.2))
    assert config.settings.laser == Laser()
    assert config.settings.radius == 2.0
    assert config.settings.obstacle_values == (
        DiscObstacle(1.0, 2.0, 3.0),
        PolygonObstacle(((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.5, 0.2))),
    )
    assert config.settings.rule_parameters["tickets"] == 3
    assert config.settings.rule_parameters["still_speed"] == 0.1
    assert config.to_document()["note"] == "kept"
    assert load_config(document | {"rules": False, "laser": False}).settings.rule_parameters == {}


def test_counts_are_multiplied_out() -> None:
    agents = [
        {"type": "wander", "count": 2},
        {"type": "parked", "name": "van", "count": 1},
        {"type": "loop", "count": 1, "parameters": {"speed": 1}},
        {"type": "follow", "name": "tail"},
        {"type": "wander", "name": "none", "count": 0},
    ]
    planned = load_config(bad.base(e_agents=agents)).agents
    assert [plan.agent.name for plan in planned] == ["agent0", "agent1", "van0", "agent2", "tail"]
    assert [plan.agent.kind for plan in planned] == ["wander", "wander", "parked", "loop", "follow"]
    assert planned[3].agent.parameters["speed"] == 1.0


def test_given_starts_are_kept_exactly() -> None:
    agents = [{"type": "wander", "name": "a", "start": [3, 1, 0]}, {"type": "wander", "name": "b"}]
    document = bad.base(e_agents=agents, ego={"start": [0.1, 0.2, 0.0]})
    starts = draw(load_config(document)).starts
    assert starts[:2] == (Pose(0.1, 0.2, 1.0, 0.0), Pose(3.0, 1.0, 1.0, 0.0))


@pytest.mark.parametrize("name", KINDS)
def test_every_kind_has_parameters_with_defaults(name: str) -> None:
    given: dict[str, Any] = {"commands": [[1, 0.5, 0]]} if name == "scripted" else {}
    parameters = parameters_of(kind_of(name), given)
    assert parameters_of(name, parameters) == parameters
    assert json.loads(json.dumps(parameters)) == parameters


def test_a_relative_network_is_found_beside_the_configuration_then_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there, here = tmp_path / "there", tmp_path / "here"
    for folder, length in ((there, 5.0), (here, 7.0)):
        folder.mkdir()
        (folder / "square.json").write_text(json.dumps(SQUARE | {"length": length}))
    (here / "other.rnd").write_text("version: 0\nlength: 9\nshape: 2 2\n")
    monkeypatch.chdir(here)
    file = there / "config.json"
    for name, length in (("square.json", 5.0), ("other.rnd", 9.0), (str(here / "square.json"), 7.0)):
        for named in ({"rnd": name}, {"rnd": ..., "network": {"file": name}}):
            file.write_text(json.dumps(bad.base(**named)))
            network = load_config(file).network
            assert network is not None
            assert network.length == length
    overriding = load_config(file, rnd="square.json").network
    assert overriding is not None
    assert overriding.length == 7.0


def test_a_network_given_beside_overrides_that_of_any_configuration(tmp_path: Path) -> None:
    path = tmp_path / "square.json"
    path.write_text(json.dumps(SQUARE))
    for document in (bad.base(), bad.base(rnd=...), load_config("town").to_document()):
        config = load_config(document | {"rules": False}, rnd=path)
        assert config.network == RoadNetwork.from_document(SQUARE)


def test_standard_input_is_read() -> None:
    code = "from dubins_traffic.problem.configuration import load_config as f; print(f('-').number_trials)"
    text = json.dumps(bad.base(number_trials=17))
    done = subprocess.run([sys.executable, "-c", code], input=text, capture_output=True, text=True, check=True)
    assert done.stdout == "17\n"


def test_drawing_and_writing_load_no_compiler() -> None:
    code = """
import sys
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.document import instance_from_document, instance_to_document
instance_from_document(instance_to_document(draw(load_config("town"))))
assert not {"numba", "matplotlib", "pyarrow", "typer"} & set(sys.modules)
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_a_configuration_may_be_sent_to_another_process() -> None:
    for name in shipped_names():
        config = load_config(name)
        assert draw(pickle.loads(pickle.dumps(config)), 2, 3) == draw(config, 2, 3)


@pytest.mark.parametrize(("seed", "trial"), [(-1, 0), (2**64, 0), (0, -1), (0, 2**32), (True, 0)])
def test_seeds_and_trials_out_of_range_are_refused(seed: int, trial: int) -> None:
    with pytest.raises(InputError, match=r"(seed|trial): not a (seed|trial): got .* expected an integer"):
        draw(load_config("demo"), seed, trial)


def test_the_instance_of_2016_is_read_and_written_back() -> None:
    document = json.loads((GOLDEN / "instance-3x4.json").read_text())
    instance = load_instance(GOLDEN / "instance-3x4.json")
    assert instance_to_document(instance, version=0) == document
    assert instance.problem.goals == ((2, 0),)
    assert instance.starts == (Pose(0.0, 0.0, 1.0, 0.0),)
    assert 30 <= instance.duration <= 90
    assert instance == load_instance(GOLDEN / "instance-3x4.json")
    assert load_instance(GOLDEN / "instance-3x4.json", seed=1).duration != instance.duration
    again = instance_from_document(document | {"version": 1})
    assert again == instance


def test_a_version_0_instance_keeps_unknown_keys_and_ignores_them() -> None:
    document = {"version": 0, "goals": [[0, 1], [0, 1]], "rnd": SQUARE, "car": 3, "intersection_radius": 0.7}
    instance = instance_from_document(document)
    written = instance_to_document(instance, version=0)
    segments = [[0, 0, 1, 0], [0, 0, 0, 1], [0, 1, 1, 1], [1, 0, 1, 1]]
    assert written == document | {"rnd": SQUARE | {"segments": segments}}
    assert instance.problem.intersection_radius == 0.7
    assert instance.problem.car.body == Disc()


def test_a_full_instance_has_the_keys_of_version_0_and_more() -> None:
    instance = draw(load_config("demo"), 3)
    short, full = instance_to_document(instance, version=0), instance_to_document(instance)
    assert list(short) == ["version", "goals", "rnd", "intersection_radius"]
    assert {key: full[key] for key in short} == short | {"version": 1}
    assert {"starts", "duration", "e-agents", "seed", "trial"} <= set(full)
    assert instance_from_document(full) == instance
    assert json.loads(dumps(full)) == full


def test_a_start_may_be_given_by_an_angle_and_others_drawn() -> None:
    document = bad.instance(starts={"a": [3, 1, 0]}, **{"e-agents": [{"type": "wander", "name": "a"}]})
    instance = instance_from_document(document)
    assert instance.starts == (Pose(0.0, 0.0, 1.0, 0.0), Pose(3.0, 1.0, 1.0, 0.0))


def test_trial_data_is_json_with_the_keys_of_2016(tmp_path: Path) -> None:
    config = load_config("demo")
    instances = [draw(config, 0, trial) for trial in range(3)]
    data = TrialData.build(config, instances, datetime(2016, 5, 16, 9, 30, tzinfo=UTC))
    data.write(tmp_path / "data.json")
    document = json.loads((tmp_path / "data.json").read_text())
    assert list(document) == ["version", "date", "trialconf", "instances"]
    assert document["date"] == "2016-05-16 09:30:00"
    assert document["trialconf"] == config.to_document()
    assert document["instances"] == [instance_to_document(instance, version=0) for instance in instances]
    assert TrialData.read(tmp_path / "data.json") == data


@pytest.mark.parametrize("named", [{"rnd": "square.net.xml"}, {"rnd": ..., "network": {"file": "square.net.xml"}}])
def test_a_network_that_was_named_by_path_is_written_in(named: dict[str, Any], tmp_path: Path) -> None:
    """In trial data, what a campaign or a competition keeps, and a search."""
    RoadNetwork.from_document(SQUARE).write(tmp_path / "square.net.xml")
    config = Configuration.from_document(bad.base(**named), folder=tmp_path)
    data = TrialData.build(config, [], datetime(2016, 5, 16))
    assert data.trialconf == config.inlined()
    for document in (data.trialconf, prepared(config, None, {}).document):
        assert RoadNetwork.from_document(document["rnd"]) == config.network
        assert "network" not in document
        assert Configuration.from_document(document).network == config.network
    assert config.to_document() == bad.base(**named)
    Draft202012Validator(shipped("configuration")).validate(config.to_document())


def test_shipped_schemas_are_valid_and_up_to_date() -> None:
    made = schemas()
    assert len(made) == 8
    for where, schema in made.items():
        Draft202012Validator.check_schema(schema)
        assert place(*where).read_text(encoding="utf-8") == text(schema), f"{place(*where)}: run `{MAKE}`"
    package = Path(dt.__file__).parent
    assert {place(*where) for where in made} == set(package.glob("*/schemas/*.json"))


def test_valid_documents_agree_with_the_schemas() -> None:
    documents: list[tuple[str, Any]] = [("configuration", load_config(name).to_document()) for name in shipped_names()]
    instances = [draw(load_config(name), 1) for name in shipped_names()]
    documents += [("instance", instance_to_document(i, version)) for i in instances for version in (0, 1)]
    documents += [("network", i.problem.network.to_document()) for i in instances]
    documents += [("network", SQUARE), ("trial-data", bad.trial_data())]
    documents += [("instance", json.loads((GOLDEN / "instance-3x4.json").read_text()))]
    documents += [("configuration", bad.base(laser=True, rules={"tickets": 1}, ego={"start": [1, 0, 0]}))]
    for name, document in documents:
        Draft202012Validator(shipped(name)).validate(document)


# What JSON Schema can't say: relations between values, likeness of keys, and 1.0 where an integer is asked.
RELATIONS = {
    "trials with a fraction", "bounds in the wrong order", "goal off the network", "too many ticks", "no tick",
    "agent called ego", "name twice", "counts add up", "one start for many", "cycle that jumps",
    "least above largest speed", "rate too low", "laser all round and on", "bow tie", "rules on short roads",
    "rules without sight", "rules with small discs", "starts that overlap", "start in an obstacle", "too many cars",
    "impossible network", "huge grid",  "rnd is no file", "network is no file", "huge length", "start far away",
    "crossing roads", "start of nobody", "heading too long", "bad instance", "NaN", "infinite rate",
    "misspelt key", "misspelt key of an agent", "parameter of an agent beside its type",
}  # fmt: skip


@pytest.mark.parametrize(
    ("schema", "name", "document"),
    [
        pytest.param(schema, case[0], case[1], id=case[0])
        for schema, cases in (
            ("configuration", bad.CONFIGURATIONS),
            ("instance", bad.INSTANCES),
            ("trial-data", bad.TRIAL_DATA),
        )
        for case in cases
    ],
)
def test_invalid_documents_agree_with_the_schemas(schema: str, name: str, document: Any) -> None:
    validator = Draft202012Validator(shipped(schema))
    if name in RELATIONS:
        assert name in {case[0] for case in [*bad.CONFIGURATIONS, *bad.INSTANCES, *bad.TRIAL_DATA]}
        return
    with pytest.raises(ValidationError):
        validator.validate(document)
