"""The rules stated as formulas, judged by monitors, against the referee: the same rules broken at the same frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.campaign.single import run_trial
from dubins_traffic.cars.state import Frames, State
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.spec.judge import Referee
from dubins_traffic.spec.labeller import Labeller
from dubins_traffic.spec.task import task
from tests.judging import GRID, ROADS, after, before, case, frames_of, lanes_in, lanes_out
from tests.rules_scripts import Frame, fill, on_lane
from tests.signals import Key, first_breaches, first_broken, signals, stated

both = pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)


def compared(instance: Instance, frames: Frames) -> dict[Key, int]:
    """Return what is broken first and when, on which monitors and referee agree."""
    breaches, contacts = Referee([instance]).judge(frames)
    spec = task(instance.problem, instance.names)
    formulas = stated(instance, (*spec.assumptions, *spec.guarantees))
    crossings = int((instance.problem.network.degrees >= 3).sum())
    assert len(formulas) == 4 + 3 * crossings + (len(instance.names) - 1) * (3 + 4 * crossings)
    values = signals(instance, replace(frames, contacts=contacts))
    found = first_broken(formulas, values, instance.problem.period)
    assert found == first_breaches(formulas, breaches)
    return found


def labelled(instance: Instance, script: Sequence[Frame]) -> Frames:
    """Return the frames of a script with their labels."""
    labeller, state = Labeller([instance]), State.zeros(1, len(script[0]))
    columns: dict[str, list[np.ndarray]] = {"crosses": [], "lane": [], "bits": []}
    for tick, frame in enumerate(script):
        fill(state, 0, frame)
        if tick == 0:
            labeller.reset(state)
        else:
            labeller.update(tick, state, [()])
        for name, rows in columns.items():
            rows.append(getattr(labeller.labels, name)[0].copy())
    bare = frames_of(script, instance.problem.rate)
    return replace(bare, **{name: np.array(rows) for name, rows in columns.items()})


def rules_of(found: dict[Key, int], car: int = 0) -> set[str]:
    return {rule for rule, n, _ in found if n == car}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[Key, int]]:
    """Records of the shipped `town`, by controller."""
    folder: Path = tmp_path_factory.mktemp("records")
    found: dict[str, dict[Key, int]] = {}
    for controller in ("simple", "lanes"):
        for number in range(3):
            instance = replace(draw(load_config("town"), 5, number), duration=40.0)
            record = folder / f"{controller}{number}.mcap"
            run_trial(instance, controller, record=record)
            kept = read(str(record))
            found[f"{controller}{number}"] = compared(kept.instance, kept.frames)
    return found


def test_monitors_and_referee_agree_on_records(recorded: dict[str, dict[Key, int]]) -> None:
    simple = set[str]().union(*(rules_of(recorded[f"simple{k}"]) for k in range(3)))
    lanes = set[str]().union(*(rules_of(recorded[f"lanes{k}"]) for k in range(3)))
    assert {"1.road", "2.left", "3.stop"} <= simple
    assert "3.stop" in lanes
    assert "1.road" not in lanes


@both
@pytest.mark.parametrize("late", [1, 2])
def test_order(roads, late) -> None:
    one, right = lanes_in(roads)[:2]
    mine = [before(roads, one, 0.3)] * 9 + [before(roads, one, gap) for gap in (1e-6, -1e-6)]
    coming, there = on_lane(roads, right, 2.0, -0.3), before(roads, right, 0.3)
    script = [[place, there if k >= late else coming] for k, place in enumerate(mine)]
    instance = case(roads, 2)
    assert rules_of(compared(instance, labelled(instance, script))) == ({"3.order"} if late == 1 else set())


@both
@pytest.mark.parametrize("gap", [1e-6, -1e-6])
def test_clear(roads, gap) -> None:
    one, out = lanes_in(roads)[0], lanes_out(roads)[1]
    mine = [before(roads, one, 0.3)] * 8 + [before(roads, one, 1e-6), before(roads, one, -1e-6)]
    other = [after(roads, out, -0.4)] * 8 + [after(roads, out, gap), after(roads, out, 0.5)]
    instance = case(roads, 2)
    frames = labelled(instance, [list(cars) for cars in zip(mine, other, strict=True)])
    assert rules_of(compared(instance, frames)) == (set() if gap > 0 else {"3.clear"})


@pytest.mark.parametrize(("frames", "rules"), [(10, {"2.left"}), (11, {"2.left", "2.return"})])
def test_left_for_long(frames, rules) -> None:
    instance = case(GRID, 1, left_time=1.0)
    place = on_lane(GRID, lanes_in(GRID)[0], 2.0, 0.0)
    assert rules_of(compared(instance, labelled(instance, [[place]] * frames))) == rules


@pytest.mark.parametrize(("frames", "rules"), [(15, set()), (16, {"E3.enter"})])
def test_first_and_never_enters(frames, rules) -> None:
    """An e-agent stops at 0.5 s and is first from then on."""
    instance = case(GRID, 2, enter_time=1.0)
    one, two = lanes_in(GRID)[:2]
    far, near = on_lane(GRID, one, 1.8, -0.3), before(GRID, two, 0.3)
    found = compared(instance, labelled(instance, [[far, near]] * frames))
    assert rules_of(found, car=1) == rules
