"""The tables of the compiled step of environments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.tables import Tables

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt


@record
class Stride:
    """How far a trial is in the present step of its environment, and values of the last tick to compare with."""

    left: int
    """Ticks still to go in this step."""
    speed: float
    """The ego's in the frame before, m/s."""
    yaw_rate: float
    """The same, rad/s."""
    route: float
    """How far the ego had to go to the goal that it seeks, in the frame before, metres."""


@record
class Scale:
    """How actions become commands, and how long a tick is."""

    period: float
    """Seconds of a tick."""
    pause: int
    """Ticks after which a step pauses for somebody who looks at every frame; 0: it does not."""
    waits: int
    """1 if a step waits before its first tick, too, for somebody who says what the egos do in each."""
    speed: float
    """Half of the range of speeds, m/s."""
    middle: float
    """Its middle, m/s."""
    yaw_rate: float
    """The top yaw rate, rad/s."""


class StepTables(Tables):
    """The environments of one bank of trials, and the results of a step of all environments.

    Attributes
    ----------
    stride : (B,) Stride
        Of each trial of the bank.
    scale : (1,) Scale
        What all have in common.
    asked : (E, 2)
        The action of each environment, shares of speed and yaw rate, -1 to 1.
    terms : (E, T)
        Terms of the reward, without weights.
    weighted : (E, T)
        The same, with weights.
    weights : (T,)
        Their weights.
    cost_of : (R,)
        The cost that each rule is (`envs.terms.costs_of_rules`).
    reward : (E,)
        The reward.
    status : (E,)
        Why the trial stands still (`engine.batch_kernel`), RUNNING if it does not.
    flat : (E, F)
        Flat observations.
    one : (1,)
        Scratch: a trial.
    """

    stride: Rows[Stride]
    scale: Rows[Scale]
    asked: Floats
    terms: Floats
    weighted: Floats
    weights: Floats
    cost_of: Ints
    reward: Floats
    status: Ints
    flat: npt.NDArray[np.float32] | Any
    one: Ints
