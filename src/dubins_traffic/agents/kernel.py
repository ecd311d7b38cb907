"""One tick of the e-agents of a batch: which must stand, and the commands of all (compiled)."""

from __future__ import annotations

from dubins_traffic.agents.driving import pose_of
from dubins_traffic.agents.kinds import act
from dubins_traffic.agents.sight import look
from dubins_traffic.agents.tables import HELD, Agent, Scene
from dubins_traffic.cars.state import EGO, Pose
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.compile import jit, jit_rare


@jit
def decide(tick: int, begin: int, commands: Floats, scene: Scene) -> int:
    """Write the commands of the e-agents of the trials from `begin` (number) on.

    Returns B, the number of trials, or -1 - b if the buffer of pairs is too small for trial b; the commands of that
    trial and of those after it are then not written.
    """
    count = scene.state.count
    for b in range(begin, count.shape[0]):
        if count[b] > 1 and not decide_trial(b, tick, scene, commands):
            return -1 - b
    return count.shape[0]


@jit_rare
def decide_trial(b: int, tick: int, scene: Scene, commands: Floats) -> bool:
    """Write the commands of the e-agents of trial b; if the buffer of pairs is too small, write none, return False."""
    state, agents, work = scene.state, scene.agents, scene.space
    if look(scene, b) > work.search.pair.shape[0]:
        return False
    ego = pose_of(state, b, EGO)
    for n in range(1, state.count[b]):
        held = hold(tick, pose_of(state, b, n), ego, work.held[n], agents.agent[b, n])
        speed, yaw_rate = act(b, n, tick, held, scene)
        commands[b, n, 0] = speed if held & HELD.BARRED == 0 else 0.0
        commands[b, n, 1] = yaw_rate if held & HELD.TIGHT == 0 else 0.0
    return True


@jit
def hold(tick: int, pose: Pose, ego: Pose, held: int, agent: Agent) -> int:
    """Return what holds a car, bits of HELD: SEES, it stands; BARRED, it has no speed; TIGHT, it does not turn.

    `held` (bits) is what `sight.look` found.

    A car stands while it SEES a body, and has no speed near the ego. Once its patience has ended only a body in its way
    or too near holds it, and WEARY says that a body is in its way.
    """
    dx = ego.x - pose.x
    dy = ego.y - pose.y
    berth = agent.berth
    beside = dx * dx + dy * dy <= berth * abs(berth)
    if held == 0 and not beside:
        agent.since = -1
        return 0
    if agent.since < 0:
        agent.since = tick
    if agent.patience >= 0 and tick - agent.since >= agent.patience:
        return held & (HELD.BARRED | HELD.TIGHT) | (HELD.WEARY if held & HELD.BARRED != 0 else 0)
    return held & HELD.SEES | (HELD.BARRED if beside else 0)
