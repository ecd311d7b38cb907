"""`list` and the documents' page tell all parameters, their defaults and units, and follow the code."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest
from scripts.reference import renewed

from dubins_traffic.cli import catalogue
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import shipped_names
from dubins_traffic.problem.kinds import KINDS
from dubins_traffic.rules.parameters import RuleParameters

pytestmark = pytest.mark.path

PAGE = Path(__file__).resolve().parents[2] / "docs" / "documents.md"


def listed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["list", *arguments]) == 0
    return capsys.readouterr().out


def test_agents_with_parameters_defaults_and_who_cannot_keep_e1(capsys):
    out = listed(capsys, "agents")
    for name, kind in KINDS.items():
        (block,) = re.findall(rf"^{name} .*\n((?: .*\n)*)", out, re.MULTILINE)
        for key, info in kind.model_fields.items():
            assert re.search(rf"^ +{key} ", block, re.MULTILINE), key
            assert info.description
        assert ("can't keep E1" in block) == (name in {"wander", "loop", "follow", "parked", "scripted", "nudged"})
    assert re.search(r"^ +speed +0\.5 +speed between turns, m/s$", out, re.MULTILINE)
    assert re.search(r"^ +commands +required ", out, re.MULTILINE)


def test_rules_with_defaults_and_units(capsys):
    lines = {line.split()[0]: line for line in listed(capsys, "rules").splitlines() if line[0] != " "}
    assert sorted(lines) == sorted(own.name for own in fields(RuleParameters))
    for own in catalogue.rules():
        assert own.default == getattr(RuleParameters(), own.name)
        assert len(own.meaning) > 10, own.name
        counted = re.search(r", (s|m|m/s|rounds|lengths|roads|tickets|breaches|share)$", own.meaning)
        assert (counted is None) == (own.name == "edition" or own.name.startswith("assume_")), own.name


def test_configurations_with_a_line_each(capsys):
    lines = listed(capsys, "configurations").splitlines()
    assert [line.split()[0] for line in lines] == shipped_names()
    assert all(re.search(r"\d+ trials of .* s, .* goals.*, .*judged", line) for line in lines)


@pytest.mark.parametrize(
    "subject", ["agents", "configurations", "controllers", "map-formats", "metrics", "rules", "simulators"]
)
def test_all_of_it_as_json(subject, capsys):
    found: list[dict[str, Any]] = json.loads(listed(capsys, subject, "--json"))[subject]
    names = [line.split()[0] for line in listed(capsys, subject).splitlines() if line[0] != " "]
    assert [own["name"] for own in found] == names
    assert all(own["description"] for own in found)
    if subject == "agents":
        speed = {
            "name": "speed",
            "required": False,
            "default": 0.5,
            "description": "speed between turns, m/s",
        }
        assert speed in found[0]["parameters"]


def test_the_page_is_up_to_date():
    page = PAGE.read_text(encoding="utf-8")
    assert page.count("<!-- generated: ") == 3
    command = "python -m scripts.reference docs/documents.md"
    assert renewed(page) == page, f"run `{command}`"
    assert command in page
    assert all(f"| `{own.name}` | {own.shown} |" in page for own in catalogue.rules())


def test_a_part_of_nothing_is_refused():
    with pytest.raises(InputError, match="no such part: got 'cars'"):
        renewed("<!-- generated: cars -->\n<!-- end -->")


def test_long_names_of_the_options_of_2016(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--help"]) == 0
    text = capsys.readouterr().out
    assert "--trial-data" in text
    assert "--overwrite-trial-data" in text
    config = {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "rnd": {"version": 0, "length": 3, "shape": [2, 2]},
    }
    Path("c.json").write_text(json.dumps(config | {"duration": 0.1}))
    run = ["run", "c.json", "--controller", "simple", "--json"]
    assert main([*run, "--trial-data", "d.json"]) == 0
    assert main([*run, "--trial-data", "d.json"]) == 2
    assert "--overwrite-trial-data (-F)" in capsys.readouterr().err
    assert main([*run, "--overwrite-trial-data", "d.json"]) == 0
    assert main([*run, "-F", "d.json"]) == 0
    assert main([*run, "-f", "e.json"]) == 0
