"""Campaign files: what they say, what is refused, and from which seeds their trials follow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from scripts.schemas import ID, shipped

from dubins_traffic.campaign.campaign import Campaign, load_campaign, seed_of
from dubins_traffic.campaign.chunks import LEAST_CAR_STEPS, MOST_CAR_STEPS, Pace, cost
from dubins_traffic.campaign.folder import remaining
from dubins_traffic.campaign.settings import put, raised, scalar, vary
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw

BASE: dict[str, Any] = {
    "version": 0,
    "controllers": ["lanes", "simple"],
    "configurations": ["demo"],
    "trials": 10,
}
TOWN = load_config("town").to_document()


def made(**changes: Any) -> Campaign:
    return Campaign.from_document({**BASE, **changes}, "c.toml")


def test_factors_are_crossed_and_every_trial_has_one_number() -> None:
    campaign = made(
        configurations=["demo", "town"],
        factors={"e_agents": [0, 2, 5], "duration": [10, 20.5]},
        fields={"disturbances.position_noise": [0.0, 0.1]},
        chunk=4,
    )
    assert len(campaign.cells) == 2 * 3 * 2 * 2
    assert campaign.factors == ("e_agents", "duration", "disturbances.position_noise")
    assert campaign.total == 24 * 2 * 10
    chunks = list(campaign.chunks())
    assert [n for chunk in chunks for n in range(chunk.number, chunk.end)] == list(range(campaign.total))
    assert max(chunk.count for chunk in chunks) == 4
    last = campaign.cells[-1]
    instance = draw(last.settled, last.seed, 3)
    assert (len(instance.e_agents), instance.duration, instance.disturbances.position_noise) == (5, 20.5, 0.1)


def test_instances_depend_on_neither_controllers_nor_other_cells() -> None:
    few = made(factors={"e_agents": [2]})
    many = made(controllers=["rules"], configurations=["town", "demo"], factors={"e_agents": [0, 2]}, trials=3)
    seeds = {(cell.configuration, cell.values["e_agents"]): cell.seed for cell in many.cells}
    assert few.cells[0].seed == seeds["demo", 2]
    assert len(set(seeds.values())) == 4
    assert seed_of(1, "demo", {"e_agents": 2}) != seed_of(0, "demo", {"e_agents": 2})


def test_what_is_stored_reads_back_as_the_same_campaign() -> None:
    campaign = made(factors={"e_agent_kinds": ["lawful", ["lawful", {"type": "nemesis"}]], "rules": [True]})
    again = Campaign.from_document(campaign.document)
    assert again.document == campaign.document
    assert [cell.settled.document for cell in again.cells] == [cell.settled.document for cell in campaign.cells]


FACTORS: list[tuple[str, Any, str, Any]] = [
    ("lane_width", 0.7, "car.w", 0.35),
    ("speed", 0.4, "car.bounds.speed", 0.4),
    ("yaw_rate", 2.0, "car.bounds.yaw_rate", 2.0),
    ("turning_radius", 0.2, "car.bounds.turning_radius", 0.2),
    ("sensing_radius", 6.0, "sensing_radius", 6.0),
    ("rules", {"tickets": 2}, "rules.tickets", 2),
    ("duration", 12.0, "duration", 12.0),
    ("grid", [4, 5], "network.grid.columns", 5),
    ("intersections", 12, "network.random.intersections", 12),
]


@pytest.mark.parametrize(("name", "value", "path", "found"), FACTORS, ids=[case[0] for case in FACTORS])
def test_a_factor_changes_what_it_is_called_after(name: str, value: Any, path: str, found: Any) -> None:
    place: Any = vary(TOWN, {name: value}, {})
    for key in path.split("."):
        place = place[key]
    assert place == found


def test_the_size_of_a_random_network_keeps_its_density() -> None:
    dense = {**TOWN, "network": {"random": {"intersections": 9, "segments": 12}}}
    dense.pop("rnd", None)
    wanted = vary(dense, {"intersections": 25}, {})["network"]["random"]
    assert wanted == {"intersections": 25, "segments": 40}


def test_a_configuration_of_2016_keeps_its_meaning() -> None:
    old = load_config("demo")
    new = load_config(raised(old.to_document()))
    assert new.version == 1
    assert draw(new, 3, 1) == draw(old, 3, 1)


def test_e_agents_are_taken_in_turn() -> None:
    agents = vary(
        {"version": 1, "e-agents": [{"type": "lawful", "count": 2}, {"type": "parked", "name": "p"}]},
        {"e_agents": 3},
        {},
    )["e-agents"]
    assert [(agent["type"], agent["name"]) for agent in agents] == [
        ("lawful", "agent0"),
        ("parked", "agent1"),
        ("lawful", "agent2"),
    ]


def test_values_are_told_in_words() -> None:
    kinds = [{"type": "lawful", "parameters": {"rolls": 0.2}}, {"type": "nemesis", "parameters": {}}]
    assert scalar(kinds) == "lawful(rolls=0.2)+nemesis"
    assert scalar([3, 4]) == "3x4"
    assert scalar(True) is True
    assert scalar({"b": 1, "a": 2}) == '{"a": 2, "b": 1}'


def test_paths_lead_through_objects_and_lists() -> None:
    document: dict[str, Any] = {"rules": True, "e-agents": [{"type": "lawful"}]}
    put(document, "rules.tickets", 2)
    put(document, "e-agents[0].parameters.speed", 0.3)
    assert document == {
        "rules": {"tickets": 2},
        "e-agents": [{"type": "lawful", "parameters": {"speed": 0.3}}],
    }


def test_a_misspelt_key_comes_before_the_one_that_is_missing_for_it() -> None:
    misspelt = {"controlers" if key == "controllers" else key: value for key, value in BASE.items()}
    with pytest.raises(InputError) as caught:
        Campaign.from_document(misspelt, "c.toml")
    assert str(caught.value).startswith("c.toml: controlers: unknown key (and 1 more fault): got ['lanes'")
    assert "expected controllers, or one of version, " in str(caught.value)


WRONG: list[tuple[dict[str, Any], str]] = [
    ({"version": 1}, "c.toml: version: wrong value: got 1"),
    ({"controllers": []}, "c.toml: controllers: wrong value: got []; expected at least 1 items"),
    ({"controllers": ["nobody"]}, "c.toml: controllers[0]: unknown controller: got 'nobody'"),
    ({"controllers": ["lanes", "lanes"]}, "c.toml: controllers[1]: name taken: got 'lanes'"),
    ({"configurations": ["nowhere"]}, "c.toml: configurations[0]: nowhere: no such file"),
    ({"configurations": [{"name": "a"}]}, "c.toml: configurations[0]: not one configuration"),
    ({"factors": {"lanewidth": [1]}}, "c.toml: factors.lanewidth: unknown key"),
    (
        {"factors": {"e_agents": [1.5]}},
        "c.toml: factors.e_agents[0]: wrong value: got 1.5; expected an integer",
    ),
    ({"factors": {"e_agents": [1, 1]}}, "c.toml: factors.e_agents[1]: value stands twice: got 1"),
    (
        {"factors": {"grid": [[2, 2]], "intersections": [4]}},
        "c.toml: factors.grid: two kinds of road network",
    ),
    (
        {"factors": {"speed": [-1.0]}},
        "c.toml: factors.speed[0]: wrong value: got -1.0; expected a number >= 1e-06",
    ),
    ({"factors": {"e_agent_kinds": ["tram"]}}, "with e_agent_kinds = tram: e-agents[0].type: unknown type"),
    ({"fields": {"a..b": [1]}}, "not a path of a field: got 'a..b'"),
    ({"fields": {"sensing": [1]}}, "fields.sensing: unknown key: got 'sensing'"),
    ({"fields": {"e-agents[9].type": ["lawful"]}}, "leads nowhere in this configuration: got 9"),
    ({"fields": {"rate": [1e9]}}, "c.toml: configurations[0] with rate = 1000000000.0: rate: wrong value"),
    ({"trials": 99_999_999, "factors": {"e_agents": [0, 1]}}, "c.toml: trials: too many trials"),
    (
        {"fields": {"rate": list(range(1, 101)), "duration": list(range(1, 1102))}},
        "factors: too many combinations",
    ),
]


@pytest.mark.parametrize(("changes", "message"), WRONG, ids=[message[-40:] for _, message in WRONG])
def test_what_is_wrong_is_named(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        made(**changes)
    assert message in str(caught.value)


def test_what_is_not_toml_is_named(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text("version = \n")
    with pytest.raises(InputError, match=r"c.toml: not TOML \(Invalid value \(at line 1"):
        load_campaign(path)


def test_the_shipped_schema_agrees() -> None:
    schema = shipped("campaign", "campaign")
    Draft202012Validator.check_schema(schema)
    parts = [(ID + "configuration", Resource.from_contents(shipped("configuration")))]
    validator = Draft202012Validator(schema, registry=Registry().with_resources(parts))
    good = {
        **BASE,
        "factors": {"e_agent_kinds": ["lawful", ["lawful", {"type": "nemesis"}]], "rules": [True]},
    }
    validator.validate(good)
    validator.validate({**BASE, "configurations": [{"name": "own", "document": TOWN}, "demo"]})
    for changes, _ in WRONG[:2] + WRONG[6:8] + WRONG[10:11]:
        assert not validator.is_valid({**BASE, **changes})


def test_chunks_get_smaller_towards_the_end_and_hold_about_as_much_work() -> None:
    campaign = made(
        controllers=["rules", "lanes"],
        trials=3000,
        configurations=["town"],
        factors={"duration": [6.0, 60.0]},
    )
    chunks = list(campaign.chunks())
    ends = [chunk.end for chunk in chunks]
    assert [chunk.number for chunk in chunks] == [0, *ends[:-1]]
    assert ends[-1] == campaign.total
    for cell in campaign.cells:
        for place in campaign.places:
            counts = [
                chunk.count for chunk in chunks if chunk.controller == place and chunk.configuration is cell.settled
            ]
            each = cost(cell, place)
            assert max(counts) * each <= max(MOST_CAR_STEPS, each)
            assert sum(counts) == cell.count
            assert min(counts) >= max(1, int(0.5 * LEAST_CAR_STEPS / each))
    last = [chunk.count for chunk in chunks if chunk.configuration is campaign.cells[-1].settled]
    assert last == sorted(last, reverse=True)
    assert cost(campaign.cells[0], "lanes") > 10.0 * cost(campaign.cells[0], "rules")


def test_what_is_left_of_the_work() -> None:
    campaign = made(chunk=4)
    done = [(2, 9), (12, 12), (15, 16), (19, 20)]
    left = [n for chunk in remaining(campaign.chunks(), done) for n in range(chunk.number, chunk.end)]
    gone = {n for first, end in done for n in range(first, end)}
    assert left == [n for n in range(20) if n not in gone]
    assert list(remaining(campaign.chunks(), [(0, 20)])) == []
    trials = {
        chunk.number + k: (chunk.controller, chunk.trial + k)
        for chunk in remaining(campaign.chunks(), done)
        for k in range(chunk.count)
    }
    assert all(place == (("lanes", "simple")[n // 10], n % 10) for n, place in trials.items())


def test_what_was_never_asked_tells_nothing_of_the_pace() -> None:
    chunks = list(made(controllers=["simple"], chunk=10).chunks())
    pace, sizes = Pace(), list[int]()
    answers = iter([None, None, 0.01])
    for chunk in pace.pieces(chunks):
        sizes.append(chunk.count)
        pace.note(chunk, next(answers, None))
    assert sizes[:3] == [1, 1, 1]
    assert len(set(sizes[3:])) == 1, "an answer that is known stays known"
    assert sum(sizes) == 10
