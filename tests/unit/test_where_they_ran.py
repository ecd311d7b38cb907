"""Every result says whether its controller ran in a process that trusts it, or in a box."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubins_traffic.campaign import table
from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.run_campaign import run_campaign
from dubins_traffic.controllers import registry
from dubins_traffic.engine.batch import run_batch
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.runs.single import run_trial
from dubins_traffic.sandbox import available
from dubins_traffic.sandbox.layers import BOX, Layers
from dubins_traffic.sessions.registry import TRANSPORTS
from dubins_traffic.suites import running
from tests.suites import document


@pytest.mark.parametrize(
    ("name", "where"),
    [
        ("rules", "in process"),
        ("lanes+shield:law", "in process"),
        ("mine.py:Mine", "in process"),
        ("Stands", "in process"),
        ("mine.py:Mine+sandbox", "boxed"),
        ("mine.py:Mine+sandbox,memory=512M+shield", "boxed"),
        ("mine.py:Mine+sandbox,memory=512M,trust", "trusted"),
        ("ros2", "elsewhere"),
        ("stdio+shield", "elsewhere"),
        ("+shield", None),
        (None, None),
    ],
)
def test_a_name_tells_where_its_controller_ran(name: str | None, where: str | None) -> None:
    assert registry.ran(name) == where


def test_every_transport_is_known_as_such() -> None:
    assert set(TRANSPORTS) == registry.TRANSPORTS


def test_scores_say_it_one_by_one_and_in_batches() -> None:
    demo = load_config("demo")
    assert run_trial(draw(demo, 1, 0), "simple").score.to_json()["ran"] == "in process"
    (own,) = run_batch(demo, "simple", trials=1).sheet.to_json()["trials"]
    assert own["ran"] == "in process"


@pytest.mark.tools("boxes")
def test_the_table_of_a_campaign_says_it(tmp_path: Path) -> None:
    campaign = Campaign.from_document(document()["campaign"] | {"controllers": ["rules", "simple+sandbox"]})
    run_campaign(campaign, tmp_path / "out", workers=1)
    found = table.read(tmp_path / "out", campaign, [])
    pairs = set(zip(found["controller"].to_pylist(), found["ran"].to_pylist(), strict=True))
    assert pairs == {("rules", "in process"), ("simple+sandbox", "boxed")}


@pytest.mark.tools("boxes")
def test_strangers_controllers_get_boxes() -> None:
    given = [
        "rules",
        "lanes+shield",
        "saved.npz",
        "mine.py:Mine",
        "mine:Mine+shield",
        "own.py:A+sandbox,trust",
    ]
    specs, notice = running.seated(given)
    assert specs == [*given[:3], "mine.py:Mine+sandbox", "mine:Mine+sandbox+shield", given[5]]
    assert notice == ""


def test_without_boxes_a_line_says_that_they_are_trusted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(available, "available_layers", lambda: Layers(why="no bwrap").without(*BOX))
    specs, notice = running.seated(["rules", "mine.py:Mine"])
    assert specs == ["rules", "mine.py:Mine"]
    assert notice.startswith("mine.py:Mine: in process, trusted, since ")
