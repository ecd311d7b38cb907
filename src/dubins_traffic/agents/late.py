"""E-agents whose commands take effect late and who see noisy poses, and who know of both (compiled)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dubins_traffic.agents.fleet import Fleet
from dubins_traffic.cars.sensing import blurred
from dubins_traffic.cars.state import EGO, Labels, Pose, State
from dubins_traffic.kernels.arrays import Floats, Ints
from dubins_traffic.kernels.calls import bound
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.kernels.trig import advance
from dubins_traffic.policies.in_flight import Patience, settle

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance


class Foreseen(Tables):
    """What the drivers of a trial's e-agents see: each e-agent where it will be when its next command takes effect.

    `state` (1, N) and `labels` (1, N): cars and propositions; `under_way` (N, K, 2): the latest K commands of each car,
    m/s and rad/s, that of tick t in place t modulo K; `first_since`, `clear_since` (N,): see `policies.in_flight`.
    """

    state: State
    labels: Labels
    under_way: Floats
    first_since: Ints
    clear_since: Ints


class Outlook(NamedTuple):
    """How e-agents see: `position` (m, each axis) and `heading` (rad) are standard deviations, `period` (s) a tick."""

    seed: Any
    trial: int
    position: float
    heading: float
    period: float
    patience: Patience


class LateFleet(Fleet):
    """Drives the e-agents of one trial as `Fleet` does, with the trial's delay and noise (`Disturbances.cars`).

    Both are added here unless the world has its own (`Instance.added`).
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin the only trial, whose first frame is `state`."""
        (instance,) = instances
        noise, cars = instance.disturbances, len(instance.starts)
        self._delays = bool(instance.added.command_delay)
        position, heading = instance.added.position_noise, instance.added.heading_noise
        patience = Patience.of(instance.problem, noise.command_delay)
        self._outlook = Outlook(
            np.uint64(instance.seed), instance.trial, position, heading, instance.problem.period, patience
        )
        never: Any = np.full(cars, -1, dtype=np.int64)
        seen, told = State(*(column.copy() for column in state)), Labels.zeros(1, cars)
        self._seen = Foreseen(seen, told, np.zeros((cars, noise.command_delay, 2)), never, never.copy())
        self._foresee = bound(foresee)
        super().reset(instances, seen)

    def reseed(self, seed: int) -> None:
        """Let what is drawn from now on follow from another seed."""
        self._outlook = self._outlook._replace(seed=np.uint64(seed))
        super().reseed(seed)

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands that are in force in [t_k, t_k+1) into `commands` (1, N, 2), or those to be sent."""
        seen = self._seen
        self._foresee(tick, self._outlook, state, labels, seen)
        super().decide(tick, seen.state, seen.labels, commands)
        delay = seen.under_way.shape[1]
        if delay:
            asked, place = commands[0].copy(), tick % delay
            if self._delays:
                commands[0, EGO + 1 :] = seen.under_way[EGO + 1 :, place]
            seen.under_way[:, place] = asked


def fleet_of(instance: Instance) -> Fleet:
    """Return the driver of the e-agents of one trial."""
    return LateFleet() if instance.disturbances.reach_e_agents else Fleet()


@jit
def foresee(tick: int, outlook: Outlook, state: State, labels: Labels, seen: Foreseen) -> None:
    """Write what e-agents see in frame `tick` into `seen`: poses with noise, theirs moved on by commands under way.

    The noise is that of `cars.sensing.blur`, as if all poses came from one tracker.
    """
    seed, trial, position, heading, period, patience = outlook
    delay = seen.under_way.shape[1]
    seen_state, told = seen.state, seen.labels
    for n in range(state.count[0]):
        pose = Pose(state.x[0, n], state.y[0, n], state.c[0, n], state.s[0, n])
        if position > 0.0 or heading > 0.0:
            pose = blurred(pose, seed, trial, n, tick, position, heading)
        x, y, c, s = pose
        speed, yaw_rate, bits = state.speed[0, n], state.yaw_rate[0, n], int(labels.bits[0, n])
        if n != EGO and delay > 0:
            for k in range(delay):
                place = (tick + k) % delay
                speed, yaw_rate = seen.under_way[n, place, 0], seen.under_way[n, place, 1]
                x, y, c, s = advance(x, y, c, s, speed, yaw_rate, period)
            bits, seen.first_since[n], seen.clear_since[n] = settle(
                bits, tick, seen.first_since[n], seen.clear_since[n], patience
            )
        seen_state.x[0, n], seen_state.y[0, n], seen_state.c[0, n], seen_state.s[0, n] = x, y, c, s
        seen_state.speed[0, n], seen_state.yaw_rate[0, n] = speed, yaw_rate
        told.segment[0, n], told.at[0, n] = labels.segment[0, n], labels.at[0, n]
        told.crosses[0, n], told.lane[0, n] = labels.crosses[0, n], labels.lane[0, n]
        told.bits[0, n] = bits
