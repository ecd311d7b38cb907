"""How late commands take effect in a world outside, and how noisy its poses are, from what was seen."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dubins_traffic as dt
from dubins_traffic.transports.tracked import (
    LAGS,
    STAND,
    TURN,
    WATCHED,
    LagWatch,
    Measured,
    Sample,
    Turned,
    delay_of,
    measured,
)  # fmt: skip

TOLD = Turned(10.0, 10.0 + TURN, 10.0 + 2.0 * TURN, 0.6)


def turning(
    delay: float, *, rate: float = 0.6, gain: float = 1.0, noise: float = 0.0, hertz: float = 30.0
) -> list[Sample]:
    """Return what a tracker sees of a car that turns for TURN from second 10 on, and back, `delay` (s) late."""
    dice = np.random.default_rng(3)
    samples = []
    for time in np.arange(9.5, 12.5, 1.0 / hertz):
        into = min(max(time - 10.0 - delay, 0.0), 2.0 * TURN)
        heading = 3.0 + gain * rate * (TURN - abs(into - TURN)) + noise * dice.uniform(-1.0, 1.0)
        samples.append(Sample(float(time), 1.0, 2.0, math.remainder(heading, math.tau)))
    return samples


@given(st.floats(0.0, 0.4), st.floats(0.7, 1.2), st.floats(27.0, 100.0))
def test_a_delay_is_found_to_a_few_milliseconds(delay: float, gain: float, hertz: float) -> None:
    found = delay_of(turning(delay, gain=gain, noise=0.01, hertz=hertz), TOLD)
    assert found == pytest.approx(delay, abs=0.015)


def test_who_does_not_turn_tells_no_delay() -> None:
    assert delay_of(turning(0.1, gain=0.0, noise=0.01), TOLD) is None


def test_noise_and_age_of_poses_are_measured_while_cars_stand() -> None:
    dice = np.random.default_rng(5)
    times = np.cumsum(dice.uniform(0.03, 0.04, int(STAND / 0.03)))
    off = np.clip(dice.normal(0.0, 0.005, (len(times), 2)), -0.015, 0.015)
    samples = [
        Sample(float(t), 1.0 + x, 2.0 + y, 3.14 + 0.01 * (-1) ** k)
        for k, (t, (x, y)) in enumerate(zip(times, off, strict=True))
    ]
    found = measured([samples], [turning(0.05)], TOLD)
    assert found.delay == pytest.approx(0.05, abs=0.005)
    assert 0.008 < found.position < 0.017
    assert found.heading == pytest.approx(0.01, abs=0.001)
    assert 0.035 < found.interval < 0.04


def test_cars_that_only_stand_tell_their_noise() -> None:
    samples = [Sample(0.03 * k, 1.0 + 0.01 * (-1) ** k, 2.0, 0.0) for k in range(40)]
    assert measured([samples]) == Measured(None, pytest.approx(0.01), 0.0, pytest.approx(0.03))


def test_a_problem_declares_what_was_measured_or_given() -> None:
    problem = dt.draw(dt.load_config("town"), 1, 0).problem
    found = Measured(0.05, 0.012, 0.006, 1.0 / 30.0)
    declared = found.disturbances(problem)
    assert (declared.command_delay, declared.cars) == (4, "all")  # 50 ms, and poses up to 33 ms old, at 30 Hz
    assert declared.position_noise == pytest.approx(0.004)
    assert declared.heading_noise == pytest.approx(0.002)
    assert "50 ms; 4 ticks" in found.told(problem, declared)
    given_by_user = replace(found, delay=0.1).disturbances(problem, 0.003, 0.5)
    assert given_by_user.command_delay == 5
    assert given_by_user.position_noise == pytest.approx(0.001)
    assert (declared.command_loss, given_by_user.command_loss) == (0.05, 0.5)
    unknown = Measured(None, 0.0, 0.0, 0.01)
    assert unknown.disturbances(problem).command_delay == 2
    assert "--delay declares it" in unknown.told(problem, unknown.disturbances(problem))


@pytest.mark.parametrize("lag", [0, 2, 7])
def test_a_lag_is_noticed_from_the_speeds(lag: int) -> None:
    dice = np.random.default_rng(lag)
    speeds = np.repeat(dice.choice([0.0, 0.3, 0.7], 80), 15)
    watch = LagWatch(2)
    for tick in range(len(speeds)):
        seen = speeds[tick - lag] if tick >= lag else 0.0
        watch.add(np.array([speeds[tick], 0.0]), np.array([seen + dice.uniform(-0.1, 0.1), 0.0]))
        if tick < WATCHED + LAGS - 1:
            assert watch.lag(0) is None
    assert watch.lag(0) == lag
    assert watch.lag(1) is None


def test_a_steady_car_tells_no_lag() -> None:
    watch = LagWatch(1)
    for _ in range(3 * WATCHED):
        watch.add(np.array([0.7]), np.array([0.7]))
    assert watch.lag(0) is None
