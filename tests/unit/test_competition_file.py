"""Competition files: what they say, what is refused, and which trials their phases consist of."""

from __future__ import annotations

import re
import tomllib
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from referencing import Registry, Resource
from scripts.reference import renewed
from scripts.schemas import ID, shipped

from dubins_traffic.competition.competition import Competition, load_competition
from dubins_traffic.competition.templates import template_files
from dubins_traffic.errors import InputError
from dubins_traffic.problem.draw import draw
from tests.competitions import PRACTICE, ROAD, TEST, competition, document

EXAMPLE = Path(__file__).parents[2] / "examples" / "competition"


def test_the_example_and_the_template_fit_the_schema_and_load() -> None:
    configuration = Resource.from_contents(shipped("configuration"))
    registry = Registry().with_resource(ID + "configuration", configuration)
    validator = jsonschema.Draft202012Validator(shipped("competition", "competition"), registry=registry)
    template = template_files("competition")["competition.toml"]
    for text in ((EXAMPLE / "competition.toml").read_text(), template):
        dated = re.sub(r"= (\d{4}-[\d:TZ-]+)$", r'= "\1"', text, flags=re.MULTILINE)
        validator.validate(tomllib.loads(dated))
    assert [phase.name for phase in load_competition(EXAMPLE).phases] == ["practice", "validation", "test"]
    assert Competition.from_document(tomllib.loads(template)).title == "My competition"


def test_times_of_toml_are_read_in_utc() -> None:
    test = load_competition(EXAMPLE / "competition.toml").phase("test")
    assert test.closes == datetime(2027, 3, 1, tzinfo=UTC)
    assert test.is_open(datetime(2027, 2, 28, 23, 59, 59, tzinfo=UTC))
    assert not test.is_open(test.closes)
    assert test.is_closed(test.closes)


def test_the_page_has_the_keys_as_the_code_has_them() -> None:
    path = EXAMPLE.parents[1] / "docs" / "competitions" / "file.md"
    page = path.read_text(encoding="utf-8")
    assert renewed(page) == page, "run `python -m scripts.reference docs/competitions/file.md`"
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    told = tomllib.loads(text.replace("rush.json", "town"))
    assert [phase.name for phase in Competition.from_document(told).phases] == ["practice", "test"]


def phases(**test: Any) -> dict[str, Any]:
    return {"phases": {"practice": PRACTICE, "test": {**TEST, **test}}}


@pytest.mark.parametrize(
    ("changes", "field", "expected"),
    [
        ({"phases": {}}, "phases", "at least 1"),
        ({"titel": "x"}, "titel", "title, or one of version, about"),
        ({"ranking": {"metric": "rounds"}}, "ranking.metric", "counted_rounds"),
        ({"configurations": []}, "configurations", "at least 1"),
        ({"configurations": ["nowhere.json"]}, "configurations[0]", "configuration"),
        (phases(closes="2026-02-01T00:00:00"), "phases.test.closes", "a time in UTC"),
        (phases(closes="2026-02-01T00:00:00+01:00"), "phases.test.closes", "a time in UTC"),
        (phases(closes="2025-02-01T00:00:00Z"), "phases.test.closes", "a time after opens"),
        (phases(closes=None), "phases.test.closes", "may be revealed"),
        (phases(seed=-1), "phases.test.seed", "secret"),
        (phases(seed=True), "phases.test.seed", "secret"),
        (phases(shows="all"), "phases.test.shows", "aggregates or nothing"),
        (phases(trials=0), "phases.test.trials", ">= 1"),
        (phases(trials=200_000), "phases.test.trials", "100000"),
        (phases(configurations=["town"]), "phases.test.configurations[0]", "one of road"),
        (phases(configurations=["road", "road"]), "phases.test.configurations[1]", "a name of its own"),
        (phases(limits={"memory": 1}), "phases.test.limits.memory", ">= 16"),
        (phases(quota={"a_day": 0}), "phases.test.quota.a_day", ">= 1"),
        ({"phases": {"Test": PRACTICE}}, "phases.Test", "matching"),
    ],
)
def test_what_is_wrong_is_named(changes: dict[str, Any], field: str, expected: str) -> None:
    with pytest.raises(InputError) as error:
        competition(**changes)
    assert error.value.file == "small.toml"
    assert str(error.value.field).startswith(field)
    assert expected in str(error.value)


def test_the_score_of_2016_is_refused_where_it_is_not_defined() -> None:
    with pytest.raises(InputError, match="not defined here"):
        competition(ranking={"metric": "icra2016"})
    agents = {**ROAD, "e-agents": [{"type": "lawful", "name": "agent", "count": 1}]}
    made = competition(ranking={"metric": "icra2016"}, configurations=[{"name": "road", "document": agents}])
    assert made.ranking.metric == "icra2016"


def test_a_phase_says_which_trials_it_consists_of() -> None:
    two = [{"name": "road", "document": ROAD}, {"name": "demo", "file": "demo"}]
    found = competition(configurations=two)
    practice = found.phase("practice")
    assert list(practice.numbers) == list(range(12))
    assert practice.seeds() == (1,) * 12
    named, trial = practice.place(7)
    assert (named.name, trial) == ("demo", 1)
    assert practice.instance(7, 5) == draw(named.configuration, 5, 1)
    with pytest.raises(InputError, match="no such trial"):
        practice.place(12)
    with pytest.raises(InputError, match="one of practice"):
        found.phase("final")


def test_the_document_stands_for_itself_and_the_rules_for_what_decides_trials() -> None:
    found = load_competition(EXAMPLE)
    again = Competition.from_document(found.document)
    assert again.digest == found.digest
    assert [one.rules for one in again.phases] == [one.rules for one in found.phases]
    test = competition().phase("test").rules
    assert competition(**phases(quota={"a_day": 1})).phase("test").rules == test
    assert competition(**phases(limits={"bank": 1.0})).phase("test").rules != test
    assert competition(**phases(trials=7)).phase("test").rules != test


@pytest.mark.parametrize("text", ["version = ", "a = " + "[" * 5000])
def test_what_is_no_toml_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "competition.toml").write_text(text)
    with pytest.raises(InputError, match=r"competition\.toml: n.*TOML"):
        load_competition(tmp_path)


def test_documents_are_kept_apart_from_what_they_were_made_of() -> None:
    source = document()
    found = Competition.from_document(source)
    source["title"] = "other"
    assert found.document["title"] == "Small"


def test_a_trial_that_sleeps_is_waited_for_no_longer_than_two_minutes() -> None:
    """It was ten minutes, for which a worker did nothing else."""
    found = competition().phase("practice").model.limits
    assert [found.of(duration).wall_seconds for duration in (5.0, 40.0, 1000.0)] == [30.0, 80.0, 120.0]
    own = competition(**phases(limits={"wall": 7.0})).phase("test")
    assert own.limits(own.instance(0, 1)).wall_seconds == 7.0


def test_a_phase_that_sets_no_quota_has_one() -> None:
    text = {name: value for name, value in PRACTICE.items() if name != "quota"}
    practice = competition(phases={"practice": text}).phase("practice")
    assert practice.quota.a_day is not None
    assert practice.quota.queued is not None
    assert competition(**phases(quota={"total": 3})).phase("test").quota.queued is None
