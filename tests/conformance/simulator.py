"""What every simulator must do. Subclass `SimulatorConformance` and say how to make one:

class TestMine(SimulatorConformance):
    def make(self): return Mine()

Bounds on agreement are class attributes, so that a physics engine may state looser ones than exact arcs have.
"""

from __future__ import annotations

import math
from copy import deepcopy
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.body import Bounds, Car, DiscObstacle, Rectangle
from dubins_traffic.kernels.trig import advance
from dubins_traffic.protocols import Simulator
from tests.batches import pose, scene


class SimulatorConformance:
    """The suite; `position` (m) and `heading` (rad) bound the distance from the exact arc after ten seconds."""

    position = 1e-9
    heading = 1e-9
    touch = 1e-8

    def make(self) -> Simulator:
        """Return a new simulator."""
        raise NotImplementedError

    @pytest.fixture
    def simulator(self) -> Any:
        made = self.make()
        yield made
        made.close()

    def test_places_the_cars(self, simulator: Simulator) -> None:
        starts = [pose(1, 2, 0.5), pose(-3, 4, -2.5)]
        state = simulator.reset([scene(starts)])
        assert state.count.tolist() == [2]
        for n, start in enumerate(starts):
            assert (state.x[0, n], state.y[0, n]) == pytest.approx(start[:2], abs=self.position)
            assert (state.c[0, n], state.s[0, n]) == pytest.approx(start[2:], abs=self.heading)
        assert not state.speed.any()
        assert not state.yaw_rate.any()

    @pytest.mark.parametrize(("speed", "yaw"), [(0.5, 0.0), (0.5, 0.4), (-0.3, 0.2), (0.0, 0.9), (0.7, -1.5)])
    def test_follows_the_exact_arc(self, simulator: Simulator, speed: float, yaw: float) -> None:
        state = simulator.reset([scene([pose(0.3, -0.2, 1.0)])])
        expected = pose(0.3, -0.2, 1.0)
        for _ in range(300):
            simulator.step(np.array([[[speed, yaw]]]))
            expected = advance(*expected, speed, yaw, 1 / 30)
        assert math.hypot(state.x[0, 0] - expected[0], state.y[0, 0] - expected[1]) <= self.position
        assert abs(state.c[0, 0] * expected[3] - state.s[0, 0] * expected[2]) <= self.heading
        assert state.speed[0, 0] == pytest.approx(speed, abs=0.02)
        assert state.yaw_rate[0, 0] == pytest.approx(yaw, abs=0.02)

    def test_stands_without_being_driven(self, simulator: Simulator) -> None:
        state = simulator.reset([scene([pose(5, 5, 3.0)])])
        before = (state.x[0, 0], state.y[0, 0])
        for _ in range(90):
            simulator.step(np.zeros((1, 1, 2)))
        assert (state.x[0, 0], state.y[0, 0]) == pytest.approx(before, abs=self.position)

    def test_clips_commands_in_place(self, simulator: Simulator) -> None:
        car = Car(bounds=Bounds(speed=0.5, yaw_rate=1.0))
        simulator.reset([scene([pose(0, 0)], car)])
        commands = np.array([[[9.0, -9.0]]])
        simulator.step(commands)
        assert commands[0, 0].tolist() == [0.5, -1.0]

    def test_reports_one_contact_and_lets_nothing_through(self, simulator: Simulator) -> None:
        state = simulator.reset([scene([pose(0, 0), pose(1.5, 0, math.pi)])])
        contacts = []
        for _ in range(120):
            contacts += simulator.step(np.array([[[0.5, 0.0], [0.5, 0.0]]]))[0]
            assert state.x[0, 1] - state.x[0, 0] >= 0.354 - self.touch
        (contact,) = contacts
        assert (contact.car, contact.other) == (0, 1)
        assert contact.time == pytest.approx((1.5 - 0.354) / 1.0, abs=2 / 30)
        assert (contact.nx, contact.ny) == pytest.approx((1, 0), abs=0.02)
        assert min(contact.closing) > 0
        assert contact.moved == (True, True)

    def test_cars_that_pass_do_not_touch(self, simulator: Simulator) -> None:
        simulator.reset([scene([pose(0, 0), pose(2, 0.42, math.pi)])])
        for _ in range(150):
            assert not simulator.step(np.array([[[0.5, 0.0], [0.5, 0.0]]]))[0]

    @pytest.mark.parametrize("car", [Car(), Car(body=Rectangle(0.5, 0.3))])
    def test_stops_at_an_obstacle(self, simulator: Simulator, car: Car) -> None:
        state = simulator.reset([scene([pose(0, 0)], car, [DiscObstacle(1.5, 0, 0.5)])])
        contacts = []
        for _ in range(120):
            contacts += simulator.step(np.array([[[0.5, 0.0]]]))[0]
        (contact,) = contacts
        assert (contact.car, contact.other) == (0, -1)
        front = 0.177 if isinstance(car.body, Rectangle) is False else 0.25
        assert state.x[0, 0] == pytest.approx(1.0 - front, abs=max(self.touch, 1e-8))

    def test_steps_a_batch_like_singles(self, simulator: Simulator) -> None:
        if not simulator.capabilities.batched:
            with pytest.raises(Exception, match="batch"):
                simulator.reset([scene([pose(0, 0)])] * 2)
            return
        scenes = [scene([pose(0, 0), pose(1, 0)]), scene([pose(4, 4, 1.0)])]
        commands = np.array([[[0.4, 0.1], [0.1, 0.0]], [[0.5, -0.3], [0.0, 0.0]]])
        state = simulator.reset(scenes)
        for _ in range(60):
            simulator.step(commands.copy())
        together = [(state.x[b, 0], state.y[b, 0], state.c[b, 0], state.s[b, 0]) for b in range(2)]
        for b, one in enumerate(scenes):
            state = simulator.reset([one])
            for _ in range(60):
                simulator.step(commands[b : b + 1, : len(one.starts)].copy())
            assert (state.x[0, 0], state.y[0, 0], state.c[0, 0], state.s[0, 0]) == together[b]

    def test_repeats_itself(self, simulator: Simulator) -> None:
        if not simulator.capabilities.deterministic:
            return
        ends = []
        for _ in range(2):
            state = simulator.reset([scene([pose(0, 0), pose(1.2, 0.1, math.pi)])])
            for _ in range(90):
                simulator.step(np.array([[[0.5, 0.01], [0.4, 0.0]]]))
            ends.append(b"".join(column.tobytes() for column in state))
        assert ends[0] == ends[1]

    def test_goes_on_twice_if_it_says_so(self, simulator: Simulator) -> None:
        if not simulator.capabilities.forks:
            return
        first = simulator.reset([scene([pose(0, 0), pose(1.2, 0.1, math.pi)])])
        drive = np.array([[[0.5, 0.01], [0.4, 0.0]]])
        for _ in range(10):
            simulator.step(drive.copy())
        copied, state = deepcopy((simulator, first))
        for _ in range(5):
            copied.step(-drive)
        (again, same) = deepcopy((simulator, first))
        ends = [
            ([own.step(drive.copy()) for _ in range(60)], b"".join(column.tobytes() for column in its))
            for own, its in ((simulator, first), (again, same))
        ]
        assert ends[0] == ends[1]
        assert any(contacts for (contacts,) in ends[0][0])
        assert state.x[0, 0] < first.x[0, 0]
