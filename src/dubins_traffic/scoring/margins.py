"""How far the ego stays from breaking the rules that have a measure: collisions, the road, the lane, the way back."""

from __future__ import annotations

import math

import numpy as np

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.cars.tables import pack_cars
from dubins_traffic.kernels.arrays import Bits, Floats
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.sink import Ending
from dubins_traffic.scoring.clearance import Clearance
from dubins_traffic.spec.logic.formula import always, eventually, implies, negation, prop
from dubins_traffic.spec.logic.robustness import robustness
from dubins_traffic.spec.parameters import RuleParameters
from dubins_traffic.spec.propositions import LEFT, ON_ROAD, OVERTAKING


class Margins:
    """The robustness of the ego's rules 1 and 2 (`spec.logic.robustness`), in metres.

    The signals are the gap to the nearest other body, the distance of the centre to the edge of the road, and how far
    the body reaches beyond the line at which `left` rises (or, once it has risen, falls); `overtaking` is infinite.
    """

    def begin(self, instance: Instance) -> None:
        """Start without a frame."""
        problem = instance.problem
        car = pack_cars([problem.car])
        self._network, self._half_road, self._period = problem.network, problem.car.lane_width, problem.period
        self._rules = RuleParameters.from_mapping(problem.rules)
        self._body = float(car.half_length[0]), float(car.half_width[0]), float(car.rounding[0])
        self._clearance = Clearance()
        self._clearance.begin(instance)
        self._bits = [np.zeros(0, dtype=np.uint32)]
        self._road = [np.zeros(0)]
        self._left = [np.zeros(0)]

    def frames(self, frames: Frames) -> None:
        """Take a block of frames."""
        self._clearance.frames(frames)
        if not len(frames):
            return
        points = np.stack([frames.x[:, EGO], frames.y[:, EGO]], axis=-1)
        self._bits.append(frames.bits[:, EGO])
        self._road.append(self._half_road - self._network.nearest_segment(points)[1])
        self._left.append(self._beyond(frames, points))

    def end(self, ending: Ending) -> None:
        """Nothing is left to do."""

    def result(self) -> dict[str, float | None]:
        """Return the robustness of each rule by its name, metres; None where nothing could break it.

        It is positive if the rule was kept and negative if it was broken, or would be if the trial ended here.
        """
        bits: Bits = np.concatenate(self._bits)
        road: Floats = np.concatenate(self._road)
        left: Floats = np.concatenate(self._left)
        begun = np.cumsum(bits & ON_ROAD) > 0
        overtaking: Floats = np.where(bits & OVERTAKING != 0, np.inf, -np.inf)
        signals = {"left": left, "overtaking": overtaking}
        line, back = prop("left"), eventually(negation(prop("left")), (0.0, self._rules.left_time))
        found: dict[str, float | None] = {"1.collision": self._clearance.result()}
        found["1.road"] = float(road[begun].min(initial=np.inf))
        for rule, formula in (
            ("2.left", implies(line, prop("overtaking"))),
            ("2.return", implies(line, back)),
        ):
            found[rule] = float(robustness(always(formula), signals, self._period)[0]) if len(left) else None
        return {
            rule: value if value is not None and math.isfinite(value) else None
            for rule, value in found.items()
        }

    def _beyond(self, frames: Frames, points: Floats) -> Floats:
        """Return how far the body reaches over the line that `left` looks at; -inf without a lane state."""
        lanes = frames.lane[:, EGO]
        half_length, half_width, rounding = self._body
        reach = np.full(len(lanes), -np.inf)
        for lane in np.unique(lanes[lanes >= 0]):
            here = lanes == lane
            tx, ty = self._network.tangents[lane >> 1]
            c, s = frames.c[here, EGO], frames.s[here, EGO]
            half = np.abs(c * ty - s * tx) * half_length + np.abs(c * tx + s * ty) * half_width + rounding
            reach[here] = self._network.lane_coordinates(int(lane), points[here])[1] + half
        risen = frames.bits[:, EGO] & LEFT != 0
        return reach - np.where(risen, self._rules.left_release, self._rules.left_set)
