"""A world that is not ours: poses come over a wire, commands go to the cars, and only the referee is here."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from time import monotonic
from typing import TYPE_CHECKING, Protocol

from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.cars.state import EGO, Contact, Pose, State
from dubins_traffic.cars.touching import Touching
from dubins_traffic.errors import ControllerError, InputError, TransportError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import Capabilities, End
from dubins_traffic.transports.tracked import (
    RATE,
    SETTLE,
    STAND,
    TURN,
    LagWatch,
    Measured,
    Sample,
    Turned,
    measured,
)  # fmt: skip

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

TOLD = 0.02
"""Cars are told what to do again after so many seconds while they are measured."""
APPEAR = 10.0
"""Seconds within which every car must have been seen."""
LATE = 0.5
"""Age of a pose above which it is late, seconds; then it is waited for as long again."""
FROZEN = 2.0
"""Seconds for which a car that is told to drive may have the very same pose."""
CREEP = 0.05
"""Speed, m/s, above which a command counts as telling a car to drive."""
LEAP, SHARE = 0.25, 1.5
"""A car jumps if it moves by more than its top speed allows times SHARE, and LEAP metres."""


@dataclass(slots=True)
class _Seen:
    """What is known of a car: its latest pose, when it came, and since when it has been the same."""

    pose: Pose
    came: float
    same_since: float


class Wire(Protocol):
    """How poses come from a world and commands get there."""

    def listen(self, names: Sequence[str], note: Callable[[str, Pose], None]) -> str:
        """Let `note` take every pose of the cars `names` from now on, from any thread; return where they come from."""
        ...

    def send(self, name: str, speed: float, yaw_rate: float) -> None:
        """Tell a car to drive at a speed, m/s, and a yaw rate, rad/s."""
        ...

    def wait(self, seconds: float) -> None:
        """Wait so long at most; poses that have come by then are noted."""
        ...


class ExternalWorld:
    """A `protocols.Simulator` that moves nothing itself: one trial at a time, in real time.

    Parameters
    ----------
    ego : bool
        Whether the ego's node sends its commands to the car itself. E-agents of kind `remote` do.
    say : callable, optional
        Is told what people should know of the world.
    """

    capabilities = Capabilities(batched=False, deterministic=False, lockstep=False)

    def __init__(self, wire: Wire, *, ego: bool, say: Callable[[str], None] | None = None) -> None:
        self._wire, self._ego, self._say = wire, ego, say
        self._lock = Lock()
        self._seen: dict[str, _Seen] = {}
        self._where = ""
        self._driven: list[str] = []
        self._samples: dict[str, list[Sample]] | None = None

    def measure(self, instance: Instance, *, turn: bool = True) -> Measured:
        """Return how noisy poses are and how late commands take effect: cars that are driven here turn a little.

        Cars that can't turn in place, that nodes elsewhere drive, or that are not to `turn` tell no delay.
        """
        self._instance, bounds = instance, instance.problem.car.bounds
        self._listen()
        self._await()
        standing = self._sampled(0.0, STAND)
        if not (turn and bounds.turning_radius == 0.0 and bounds.speed_low <= 0.0):
            return measured(list(standing.values()))
        rate = min(RATE, 0.5 * bounds.yaw_rate)
        told = Turned(monotonic(), 0.0, 0.0, rate)
        seen = self._sampled(rate, TURN)
        told = replace(told, back=monotonic())
        back = self._sampled(-rate, TURN)
        told = replace(told, stood=monotonic())
        after = self._sampled(0.0, SETTLE)
        turning = [seen[name] + back[name] + after[name] for name in self._driven]
        return measured(list(standing.values()), turning, told)

    def _sampled(self, rate: float, seconds: float) -> dict[str, list[Sample]]:
        """Tell the cars that are driven here to turn at a rate for a time; return the poses that come meanwhile."""
        with self._lock:
            samples = self._samples = {name: [] for name in self._instance.names}
        until = monotonic() + seconds
        while monotonic() < until:
            for name in self._driven:
                self._wire.send(name, 0.0, rate)
            self._wire.wait(TOLD)
        with self._lock:
            self._samples = None
        return samples

    def reset(self, instances: Sequence[Instance]) -> State:
        """Begin a trial where the cars stand; TransportError if one of them is not seen."""
        if len(instances) != 1:
            raise InputError("a world outside has no batch", field="trials", value=len(instances), expected="1")
        (self._instance,) = instances
        problem = self._instance.problem
        require_dubins(problem.car, "a world outside is known")
        self._touching = Touching(problem.car, problem.obstacles, problem.period)
        self._tick = 0
        self._told: dict[int, float] = {}
        self._watch = LagWatch(len(self._instance.names))
        self._listen()
        self._await()
        self._state = State.zeros(1, len(self._instance.names))
        self._look(None)
        return self._state

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Send the commands of the cars that are driven here, and take the poses that are in force now.

        Raises
        ------
        ControllerError
            `world_lost`, if poses are late, frozen or jump.
        """
        bounds = self._instance.problem.car.bounds
        speed, yaw_rate = commands[0, :, 0], commands[0, :, 1]
        speed.clip(bounds.speed_low, bounds.speed, out=speed)
        limit = bounds.yaw_rate
        for n, name in enumerate(self._instance.names):
            turn = min(limit, abs(speed[n]) / bounds.turning_radius) if bounds.turning_radius else limit
            yaw_rate[n] = min(max(yaw_rate[n], -turn), turn)
            if name in self._driven:
                self._wire.send(name, float(speed[n]), float(yaw_rate[n]))
        self._tick += 1
        self._look(speed)
        self._notice(speed)
        return [self._touching.update(self._tick, self._state)]

    def _notice(self, speed: Floats) -> None:
        """Say, once in a session, that commands take effect later than is declared."""
        self._watch.add(speed, self._state.speed[0])
        declared = self._instance.disturbances.command_delay
        if self._say is None or self._tick % int(self._instance.problem.rate):
            return
        for n, name in enumerate(self._instance.names):
            lag = self._watch.lag(n)
            if lag is not None and lag > declared + 1:
                self._say(
                    f"commands of {name} take effect about {lag} ticks late and {declared} are declared: drivers leave "
                    "too little room, and cars stop too late"
                )
                self._say = None
                return

    def close(self) -> None:
        """Stop the cars that are driven here."""
        for name in self._driven:
            self._wire.send(name, 0.0, 0.0)

    def _listen(self) -> None:
        """Take poses, and tell which cars are driven here."""
        names = self._instance.names
        remote = {agent.name for agent in self._instance.e_agents if agent.kind == REMOTE}
        if self._ego:
            remote.add(names[EGO])
        self._driven = [name for name in names if name not in remote]
        self._where = self._where or self._wire.listen(names, self._note)

    def _note(self, name: str, new: Pose) -> None:
        now = monotonic()
        with self._lock:
            old = self._seen.get(name)
            same = old.same_since if old is not None and old.pose == new else now
            self._seen[name] = _Seen(new, now, same)
            if self._samples is not None and name in self._samples:
                self._samples[name].append(Sample(now, new.x, new.y, math.atan2(new.s, new.c)))

    def _await(self) -> None:
        until = monotonic() + APPEAR
        while missing := [name for name in self._instance.names if name not in self._seen]:
            if monotonic() > until:
                raise TransportError(f"no pose of {missing[0]} on {self._where} within {APPEAR:g} s")
            self._wire.wait(0.02)

    def _look(self, speed: Floats | None) -> None:
        """Take the latest poses into the state; `speed` are the commands, None at the beginning."""
        state, period = self._state, self._instance.problem.period
        self._wire.wait(0.0)
        reach = SHARE * self._instance.problem.car.bounds.speed * (period + LATE) + LEAP
        for n, name in enumerate(self._instance.names):
            seen = self._latest(name)
            x, y, c, s = seen.pose
            if speed is not None:
                moved = math.hypot(x - state.x[0, n], y - state.y[0, n])
                if moved > reach:
                    raise _lost(f"{name} jumped by {moved:.2f} m")
                if self._is_frozen(n, seen, float(speed[n])):
                    raise _lost(f"the pose of {name} is frozen although it is told to drive")
                turned = math.atan2(s * state.c[0, n] - c * state.s[0, n], c * state.c[0, n] + s * state.s[0, n])
                ahead = (x - state.x[0, n]) * c + (y - state.y[0, n]) * s
                state.speed[0, n], state.yaw_rate[0, n] = (
                    math.copysign(moved, ahead) / period,
                    turned / period,
                )
            state.x[0, n], state.y[0, n], state.c[0, n], state.s[0, n] = x, y, c, s

    def _latest(self, name: str) -> _Seen:
        """Return the latest pose of a car; one that is late is waited for: this process itself may have stood still."""
        until = 0.0
        while True:
            with self._lock:
                seen = self._seen[name]
            now = monotonic()
            if now - seen.came <= LATE:
                return seen
            until = until or now + LATE
            if now > until:
                raise _lost(f"no pose of {name} for {now - seen.came:.1f} s")
            self._wire.wait(0.01)

    def _is_frozen(self, n: int, seen: _Seen, speed: float) -> bool:
        """Tell whether car n has stood in one place for too long since it was told to drive."""
        now = monotonic()
        if abs(speed) <= CREEP:
            self._told.pop(n, None)
            return False
        return now - max(seen.same_since, self._told.setdefault(n, now)) > FROZEN


def _lost(detail: str) -> ControllerError:
    return ControllerError(End.WORLD_LOST.value, detail)
