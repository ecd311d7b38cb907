"""What an agent observes of the ego in addition to its senses: its place and goal, and what each car has done."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from dubins_traffic.cars.state import EGO
from dubins_traffic.envs.step_kernel import StepTables
from dubins_traffic.kernels.compile import jit
from dubins_traffic.learning.flat_kernel import near_far, within, write_bearing
from dubins_traffic.learning.outlook import OutlookTables

NAMES = (
    "is_ego", "bearing_cos", "bearing_sin", "distance", "heading_cos", "heading_sin", "speed", "yaw_rate",
    "goal_bearing_cos", "goal_bearing_sin", "goal_distance", "route",
)  # fmt: skip
"""Names of these numbers, in order; each is from -1 to 1."""
Flats = npt.NDArray[np.float32]


@jit
def tell(row: int, first: int, place: int, out: Flats, outlook: OutlookTables, steps: StepTables) -> None:
    """Write what the car of a `row` (row) is told of the ego into `out` (F,).

    The ego stands in a `place` (index) of it, and in the row `first` (row).
    """
    state, car, ego = outlook.state, outlook.trial[row], outlook.trial[first]
    x, y, c, s = state.x[row, EGO], state.y[row, EGO], state.c[row, EGO], state.s[row, EGO]
    ec, es = state.c[row, place], state.s[row, place]
    out[0] = 1.0 if row == first else 0.0
    write_bearing(state.x[row, place] - x, state.y[row, place] - y, c, s, car.sight, out[1:4])
    out[4] = within(c * ec + s * es)
    out[5] = within(c * es - s * ec)
    out[6] = within(state.speed[row, place] / car.speed)
    out[7] = within(state.yaw_rate[row, place] / car.yaw_rate)
    out[8] = out[9] = out[10] = out[11] = 0.0
    if ego.target >= 0:
        vertex: int = outlook.roads.vert_off[ego.net] + outlook.goal[ego.target].vertex
        goal = outlook.roads.vertex[vertex]
        write_bearing(goal.x - x, goal.y - y, c, s, car.sight, out[8:11])
        out[11] = near_far(steps.stride[first].route, car.sight)
