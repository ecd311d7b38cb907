"""Instances drawn once and for all: an instance is the same on every machine and in every version."""

import json
from pathlib import Path

import pytest

from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.draw import draw

HERE = Path(__file__).parent / "instances"


@pytest.mark.parametrize(("name", "seed", "trial"), [("demo", 0, 0), ("demo", 7, 2), ("wanderers", 2**63, 41)])
def test_a_drawn_instance_is_the_golden_one(name: str, seed: int, trial: int) -> None:
    golden = json.loads((HERE / f"{name}-{seed}-{trial}.json").read_text())
    instance = draw(load_config(name), seed, trial)
    found = instance_to_document(instance)
    # Parameters of e-agents are those of the kind, whose defaults may grow, and so may those of the rules.
    if golden["rules"]:
        found["rules"] = {name: found["rules"][name] for name in golden["rules"]}
    for document in (found, golden):
        for agent in document["e-agents"]:
            agent["parameters"] = agent["parameters"].get("cycle")
    assert found == golden


@pytest.mark.parametrize("file", sorted(HERE.glob("*.json")), ids=lambda file: file.stem)
def test_a_golden_instance_reads_and_writes_back_its_keys(file: Path) -> None:
    golden = json.loads(file.read_text())
    written = instance_to_document(instance_from_document(golden))
    for key in golden.keys() - {"e-agents", "rules"}:
        assert written[key] == golden[key]
    assert bool(written["rules"]) == bool(golden["rules"])
    assert dict(golden["rules"] or {}).items() <= dict(written["rules"] or {}).items()
    for ours, theirs in zip(written["e-agents"], golden["e-agents"], strict=True):
        assert theirs["parameters"].items() <= ours["parameters"].items()
