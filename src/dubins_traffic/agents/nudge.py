"""E-agents of the kind `nudged`: commands of another kind, delayed and with noise on the speed (compiled)."""

from __future__ import annotations

from dubins_traffic.agents.tables import Agents
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_rare
from dubins_traffic.kernels.random import DRAW, uniform


@jit
def nudge(tick: int, commands: Floats, agents: Agents) -> None:
    """Delay the `commands` (B, N, 2), m/s and rad/s, of all nudged cars of a batch and add noise, in place."""
    for b in range(commands.shape[0]):
        nudge_trial(b, tick, commands, agents)


@jit_rare
def nudge_trial(b: int, tick: int, commands: Floats, agents: Agents) -> None:
    """Replace the command of each nudged car of trial b by its earlier one, at a speed with noise.

    `commands` (B, N, 2), m/s and rad/s, hold the present commands. Before its first command a car stands.
    """
    for n in range(1, commands.shape[1]):
        agent = agents.agent[b, n]
        if agent.recall < 0:
            continue
        ring = agents.recalled[agent.recall]
        span = agent.delay + 1
        now, then = tick % span, (tick + 1) % span
        ring[now, 0], ring[now, 1] = commands[b, n, 0], commands[b, n, 1]
        team = agents.team[b]
        share = 2.0 * uniform(team.seed, team.trial, n, tick, DRAW.NUDGE) - 1.0
        speed = ring[then, 0] * (1.0 + agent.noise * share)
        commands[b, n, 0] = max(min(speed, agent.fastest), -agent.fastest)
        commands[b, n, 1] = ring[then, 1]
