"""Scripts: sequences of commands, each held for some ticks, that an e-agent plays."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import accumulate

from dubins_traffic.agents.tables import Agent, Stretch
from dubins_traffic.kernels.compile import jit
from dubins_traffic.kernels.records import Rows


@jit
def play(tick: int, agent: Agent, script: Rows[Stretch]) -> tuple[float, float]:
    """Return the (speed, yaw rate) of an e-agent's script in a tick."""
    first = agent.first
    last = agent.last
    if first == last:
        return 0.0, 0.0
    total = int(script[last - 1].end)
    if total == 0 or (tick >= total and agent.repeat == 0):
        return 0.0, 0.0
    tick = tick % total
    row = agent.place
    if row < first or (row > first and script[row - 1].end > tick):
        row = first
    while script[row].end <= tick:
        row += 1
    agent.place = row
    return script[row].speed, script[row].yaw_rate


def script_rows(commands: Sequence[Sequence[float]], rate: float) -> list[tuple[float, ...]]:
    """Return (tick at which it ends, *values) of commands given as [seconds, *values], of a speed and a yaw rate, say.

    A time t, counted from the beginning of the script, is reached with tick ceil(t * rate - 1e-9), 1e15 at most.
    """
    times = accumulate(command[0] for command in commands)
    ends = [float(math.ceil(min(time * rate, 1e15) - 1e-9)) for time in times]
    return [(end, *map(float, command[1:])) for end, command in zip(ends, commands, strict=True)]
