"""Ends that a controller brings about are cases: kept once of each kind, shrunk, run again, and passed once mended."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.falsification.case import judge, read_case
from dubins_traffic.falsification.regress import regress
from dubins_traffic.falsification.search import falsify
from dubins_traffic.falsification.shrink import shrink, single_removals
from dubins_traffic.falsification.trying import driver_of
from dubins_traffic.record.sink import End

CONTROLLERS = '''
from dubins_traffic.controllers.simple import Simple


class Crashing(Simple):
    """Divides by zero beside one car, gives up beside two, and drives like `simple` elsewhere."""

    def act(self, observation):
        x, y = observation.pose.x, observation.pose.y
        near = [car for car in observation.others if abs(car.pose.x - x) + abs(car.pose.y - y) < 1.0]
        if len(near) >= 2:
            return None
        if near:
            return 1.0 / (len(near) - 1), 0.0
        return super().act(observation)


class Mended(Simple):
    """Drives like `simple`."""
'''


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ends")
    (folder / "mine.py").write_text(CONTROLLERS)
    falsify("junction", f"{folder / 'mine.py'}:Crashing", folder / "found", trials=64, seed=2)
    return folder


@pytest.fixture(scope="module")
def kept(folder: Path) -> list[Path]:
    return sorted((folder / "found" / "cases").glob("controller_fault-*.json"))


def test_each_kind_of_end_is_kept_once_and_is_none_of_the_breaches(folder: Path, kept: list[Path]) -> None:
    report = json.loads((folder / "found" / "search.json").read_text())
    assert report["faulty"] > len(kept) > 0
    broken = {name for name in report["cases"] if not name.startswith(("controller_fault", "gave_up"))}
    assert report["violated"] >= len(broken) > 0
    assert {name: report["cases"][name] for name in report["cases"] if name.startswith("controller_fault")} == {
        path.stem: read_case(path).story.sentence for path in kept
    }


def test_a_case_ends_so_in_its_last_tick_when_it_is_run_again(folder: Path, kept: list[Path]) -> None:
    name = f"{folder / 'mine.py'}:Crashing"
    for path in kept:
        case = read_case(path)
        ending = judge(case.instance, driver_of(name), name).record.ending
        assert ending is not None
        assert (ending.end, ending.ticks) == (End.CONTROLLER_FAULT, case.story.tick)
        assert case.instance.ticks == case.story.tick + 1
        assert case.story.sentence == (f"At {case.story.tick / 30:.2f} s the controller ended the trial: {ending}.")
        assert "float division by zero" in case.story.sentence


def test_it_is_shrunk_as_a_breach_is(folder: Path, kept: list[Path]) -> None:
    """What is left ends so, and no longer with any one thing less."""
    name = f"{folder / 'mine.py'}:Crashing"
    small = shrink(kept[0])
    judged = judge(small.instance, driver_of(name), name)
    assert judged.breach("controller_fault") is not None
    assert len(small.instance.e_agents) == 1, "one car beside it is enough"
    for what, instance in single_removals(judged):
        again = judge(instance, driver_of(name), name).breach("controller_fault")
        assert again is None or again.tick < small.story.tick, what


def test_who_was_mended_passes_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    crashing = regress(folder / "found", f"{folder / 'mine.py'}:Crashing")
    of_ends = [own for own in crashing if own.case.story.rule == "controller_fault"]
    assert [("controller_fault" in own.broken, own.passed) for own in of_ends] == [(True, False)] * len(of_ends)
    mended = regress(folder / "found", f"{folder / 'mine.py'}:Mended")
    assert [outcome.fault for outcome in mended] == [""] * len(mended)
    assert all("controller_fault" not in outcome.broken for outcome in mended)
    mended_name = f"{folder / 'mine.py'}:Mended"
    assert main(["shrink", str(of_ends[0].file), "-o", str(folder / "x.json"), "--controller", mended_name]) == 2
    assert "the ego does not break the rule" in capsys.readouterr().err
