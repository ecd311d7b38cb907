"""By how much the ego keeps the rules: margins that can be worked out by hand, and their signs on trials."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.cars.body import Car, DiscObstacle, Rectangle
from dubins_traffic.cars.state import Frames
from dubins_traffic.cli.main import main
from dubins_traffic.logic.formula import always, disj, eventually, implies, negation, prop
from dubins_traffic.logic.robustness import robustness
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.judging import Judging
from dubins_traffic.scoring.margins import MARGINS, MEASURED
from dubins_traffic.scoring.score import score
from tests.judging import GRID, RHO, ROADS, case, frames_of, lanes_in
from tests.minute import a_minute
from tests.recordings import blocks
from tests.rules_scripts import Frame, label, on_lane

BOX = Car(body=Rectangle(0.5, 0.26))


def margins(instance: Instance, script: Sequence[Frame], size: int = 7) -> dict[str, float | None]:
    """Return the robustness of a script, fed in blocks with the lane states and flags of its cars."""
    found = label([instance], [script])
    lane, bits = (np.array([getattr(one, name)[0] for one in found]) for name in ("lane", "bits"))
    return of(instance, replace(frames_of(script, instance.problem.rate), lane=lane, bits=bits), size)


def of(instance: Instance, frames: Frames, size: int) -> dict[str, float | None]:
    judging = Judging()
    judging.begin(instance)
    for block in blocks(frames, size):
        judging.frames(block)
    verdict = judging.result()
    assert verdict is not None
    return {rule: verdict.robustness[rule] for rule in ("1.collision", *MEASURED)}


@pytest.mark.parametrize("roads", ROADS.values(), ids=ROADS)
@pytest.mark.parametrize(("car", "half"), [(Car(), RHO), (BOX, 0.13)], ids=["disc", "rectangle"])
def test_of_a_car_that_drifts_to_the_right(roads, car: Car, half: float) -> None:
    """Nothing is near. It drifts from 0.3 to 0.41 m right of the centre line, on a road 0.6 m wide on each side."""
    made = case(roads, 1)
    made = replace(made, problem=replace(made.problem, car=car))
    lane = lanes_in(roads)[0]
    found = margins(made, [[on_lane(roads, lane, 2.0 + 0.02 * k, -0.3 - 0.01 * k)] for k in range(12)])
    assert found["1.collision"] is None
    assert found["1.road"] == pytest.approx(0.6 - 0.41)
    assert found["2.left"] == pytest.approx(0.05 + 0.3 - half)
    assert found["2.return"] == pytest.approx(0.05 + 0.41 - half)


@pytest.mark.parametrize(("frames", "margin"), [(5, -RHO), (12, -RHO), (13, 0.35 - RHO)])
def test_of_one_that_comes_back(frames: int, margin: float) -> None:
    """On the centre line in frames 1 to 11, which is over a second, then back; a second is allowed."""
    made = case(GRID, 1, left_time=1.0)
    lane = lanes_in(GRID)[0]
    script = [[on_lane(GRID, lane, 2.0, 0.0 if 0 < k < 12 else -0.3)] for k in range(frames)]
    found = margins(made, script)
    assert found["2.left"] == pytest.approx(-RHO)
    assert found["2.return"] == pytest.approx(-RHO)
    short = margins(case(GRID, 1, left_time=2.0), script)["2.return"]
    assert short == pytest.approx(margin)


@pytest.mark.parametrize("seed", range(4))
def test_against_the_robustness_of_the_formulas(seed: int) -> None:
    """Scripts at random: the same numbers as from the formulas of rule 2 over whole signals."""
    draws = np.random.default_rng(seed)
    made = case(GRID, 1, left_time=0.7)
    lane, count = lanes_in(GRID)[0], 90
    left = np.cumsum(draws.normal(0.0, 0.04, count)) - 0.2
    script = [[on_lane(GRID, lane, 1.5 + 0.01 * k, float(left[k]))] for k in range(count)]
    frames = frames_of(script, made.problem.rate)
    bits = np.where(left + RHO > 0.05, FLAG.LEFT, 0) | FLAG.ON_ROAD
    bits |= np.where(draws.random(count) < 0.3, FLAG.OVERTAKING, 0)
    bits |= np.where(draws.random(count) < 0.1 * (seed % 2), FLAG.HEMMED, 0)
    lanes = np.where(draws.random(count) < 0.1, -1, lane)
    frames = replace(frames, lane=lanes[:, None], bits=bits[:, None].astype(np.uint32))
    found = of(made, frames, 11)
    beyond = left + RHO - np.where(bits & FLAG.LEFT, 0.0, 0.05)
    signals = {
        "left": np.where(lanes >= 0, beyond, -np.inf),
        "overtaking": np.where(bits & FLAG.OVERTAKING, np.inf, -np.inf),
        "hemmed": np.where(bits & FLAG.HEMMED, np.inf, -np.inf),
    }
    line, period = prop("left"), made.problem.period
    for rule, then in (
        ("2.left", prop("overtaking")),
        ("2.return", eventually(disj(negation(line), prop("hemmed")), (0.0, 0.7))),
    ):
        value = float(robustness(always(implies(line, then)), signals, period)[0])
        assert found[rule] == pytest.approx(value, abs=1e-12), rule


def test_of_what_is_near() -> None:
    made = case(GRID, 2)
    lane = lanes_in(GRID)[0]
    x, y, _, _ = on_lane(GRID, lane, 2.0, -0.9)
    made = replace(made, problem=replace(made.problem, obstacles=(DiscObstacle(x, y, 0.1),)))
    far = on_lane(GRID, lanes_in(GRID)[1], 2.0, -0.3)
    script = [[on_lane(GRID, lane, 1.8 + 0.02 * k, -0.3), far] for k in range(20)]
    assert margins(made, script)["1.collision"] == pytest.approx(0.6 - 0.1 - RHO)


@pytest.mark.parametrize("controller", ["rules", "lanes", "simple"])
def test_signs_agree_with_the_verdict_on_records(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], controller: str
) -> None:
    for number in range(3):
        file = tmp_path / "a.mcap"
        run_trial(draw(a_minute("town"), 5, number), controller, record=file, overwrite=True)
        kept = read(str(file))
        verdict = score(kept).verdict
        assert verdict is not None
        assert list(verdict.robustness) == [*MARGINS[:-1]]
        for rule, value in verdict.robustness.items():
            assert value is None or (value > 0.0) == (verdict.formulas[rule] == "presumably true"), rule
        own = {rule: verdict.robustness[rule] for rule in ("1.collision", *MEASURED)}
        assert of(kept.instance, kept.frames, 100) == own
    assert main(["score", str(file), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["trials"][0]["verdict"]["robustness"] == verdict.robustness
    assert main(["check", str(file)]) == 0
    assert f"  robustness: 1.collision {verdict.robustness['1.collision']:.3f} m" in capsys.readouterr().out
