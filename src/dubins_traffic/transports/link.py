"""One session's dealings with all remote drivers: frames out, commands in, and names for what goes wrong.

Where states are shown more often than once a tick, those between two frames are made here, and what each car sees.
Remote cars are what a trial knows: the ego a Controller, e-agents a Driver.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from time import monotonic
from typing import TYPE_CHECKING, Any, Protocol, Self, runtime_checkable

import numpy as np

from dubins_traffic.cars.state import EGO, Command, Contact, Labels, Observation, State
from dubins_traffic.errors import InputError, PeerError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.observations.senses import Senses
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import (
    Clock,
    Closes,
    Controller,
    Driver,
    End,
    Ending,
    Looks,
    Polled,
    Reports,
    Streams,
    Transport,
    View,
)
from dubins_traffic.transports.clocks import Patience
from dubins_traffic.transports.inbox import Inbox, Punctuality, Slot

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance, Problem
    from dubins_traffic.record.wall import Wall

EGO_NAME = "ego"
IDLE = 0.1
"""Seconds between two looks at what has arrived, and two views of a world that stands still."""
AGAIN = 1.0
"""Seconds after which a frame that nobody answers is sent again, where answers say what they answer."""
NEVER_BY_ITSELF = 1e9


@runtime_checkable
class Loses(Protocol):
    """A tagged transport that may lose messages.

    It says after how many seconds a frame is sent again first; each further wait is twice as long, to a second.
    """

    again: float


class Link:
    """What a trial knows of a transport: a `protocols.Watcher` with commands.

    Parameters
    ----------
    transport : Transport
        Carries the messages; opened here.
    clock : Clock
        `clocks.Lockstep` or `clocks.RealTime`.
    ego : bool
        Whether the ego is remote. E-agents are if their kind is `remote`.
    patience : Patience
        How long peers are waited for.
    """

    def __init__(
        self, transport: Transport, clock: Clock, *, ego: bool = True, patience: Patience | None = None
    ) -> None:
        self.transport = transport
        self.clock = clock
        self.ego = ego
        self._patience = patience or Patience()
        self.inbox = Inbox(self._patience.flood)
        self._stream = transport if isinstance(transport, Streams) else None
        self._polled = transport if isinstance(transport, Polled) else None
        self._looks = transport if isinstance(transport, Looks) else None
        self._between = self._stream is not None and not clock.lockstep
        self._interval = IDLE if self._stream is None else self._stream.interval
        self.mark: Callable[[bool], None] = lambda _running: None
        """Called when a trial begins (True) and when it is over (False), before its peers are told."""
        transport.open(self.inbox)

    def begin(self, instance: Instance) -> None:
        """Put the world of a trial up."""
        self._instance = instance
        self._remote = [agent.name for agent in instance.e_agents if agent.kind == REMOTE]
        if self.ego:
            self._remote.insert(0, EGO_NAME)
        self._sights = CarViews(instance)
        self._running = False
        self._moving = False
        self._announced = 0.0
        self._begun: float | None = None
        self._sent = 0.0
        self._punctuality = Punctuality(self._remote)
        self.inbox.expect(self._remote)
        self.transport.begin(instance, self._remote)

    def watch(
        self,
        tick: int,
        state: State,
        labels: Labels,
        contacts: Sequence[Contact],  # noqa: ARG002  # drivers are sent poses and labels
        observe: Callable[[], Observation],
    ) -> None:
        """Send frame `tick` when it is due."""
        if self._running:
            due = self.clock.due(tick)
            self._pass_time(due, state)
            self._slip(due)
        self._tick = tick
        self._state, self._labels = kept(state, labels) if self._between else (state, labels)
        self._sights.take(tick, self._state, self._labels, observe)
        if self._running:
            self._halt()
        self._send()

    def announce(self) -> None:
        """Tell the problem once, and wait for the ego's first command if it is remote."""
        if self._running:
            return
        self._running = True
        self.mark(True)
        self.inbox.stale()
        self.transport.announce(self._instance)
        self._announced = monotonic()
        # Frame 0 has been shown before. Who answers that as soon as the problem is there may not answer it again.
        self._send_new()
        if self.ego and not self._patience.at_once:
            self._first_command(self.inbox.slot(EGO_NAME))
        self.clock.start(self._instance.problem.period, monotonic())
        self._sent = monotonic()
        self._moving = True

    def command(self, car: str, tick: int) -> tuple[float, float]:
        """Return the speed and yaw rate of `car` that answer frame `tick`, or that are in force.

        PeerError if there are none: the peer is silent, gone or at fault, or all is to end.
        """
        slot = self.inbox.slot(car)
        until = self.clock.until(tick, self._sent)
        if tick == 0 and self.clock.lockstep:
            until = max(until, self._announced + self._patience.begin)
        answered = self._wait(lambda: self._answers_frame(slot, tick), until, car)
        if not answered and self.clock.lockstep and self._has_gone(slot):
            back = monotonic() + self._patience.absence + IDLE
            answered = self._wait(lambda: self._answers_frame(slot, tick), back, car)
        if answered and slot.arrived is not None:
            self._punctuality.answered(car, slot.arrived - self._sent)
            if self._repeated:
                self._settle()
        elif self.clock.lockstep:
            raise PeerError(End.DEADLINE.value, f"no command within {until - self._sent:.3g} s at tick {tick}")
        else:
            self._punctuality.missed(car)
            self._check_silence(slot, tick)
            if tick == self._instance.ticks - 1 and (self._has_gone(slot) or self._punctuality.fades(car)):
                self._hear_out(slot, car, tick)
        with self.inbox.condition:
            return slot.speed, slot.yaw_rate

    def idle(self, done: Callable[[], bool]) -> None:
        """Show the world as it stands until `done`, or PeerError if all is to end."""
        while not self._wait(done, monotonic() + IDLE, None):
            if self._stream is None and not self._running:
                self._send()

    def finish(self, ending: Ending) -> None:
        """Tell the peers that the trial is over."""
        self._running = self._moving = False
        self.mark(False)
        self.transport.end(ending)

    def close(self) -> None:
        """Close the transport."""
        self.transport.close()

    @property
    def name(self) -> str:
        """Name of the transport."""
        return self.transport.name

    def controller(self) -> Controller:
        """Return the ego's driver elsewhere."""
        return RemoteController(self)

    def beside(self, controller: Controller) -> Controller:
        """Return a controller of this process whose start tells the peers that the trial begins."""
        return LocalController(self, controller)

    def agents(self) -> Driver:
        """Return the driver of the e-agents that are driven elsewhere."""
        return RemoteAgents(self)

    def completed(self, measured: Wall) -> Wall:
        """Return the wall-clock figures of the trial with those of the link."""
        begin = self.time_to_begin if self.ego else measured.time_to_begin_s
        reproducible = measured.reproducible and self.clock.lockstep
        return replace(measured, time_to_begin_s=begin, reproducible=reproducible, transport=self.report())

    @property
    def running(self) -> bool:
        """Whether a trial has begun and is not over."""
        return self._running

    @property
    def time_to_begin(self) -> float | None:
        """Seconds from the announcement to the ego's first command; None before, and for an ego that is here."""
        if self.ego and self._patience.at_once and self._begun is None:
            began = self.inbox.slot(EGO_NAME).began
            return None if began is None else max(0.0, began - self._announced)
        return self._begun

    def report(self) -> Mapping[str, Any]:
        """Return how punctual the trial was, for the sidecar of its record (docs/records.md)."""
        return {
            "name": self.transport.name,
            "clock": "lockstep" if self.clock.lockstep else "real time",
            "drivers": self._punctuality.drivers({car: self.inbox.slot(car) for car in self._remote}),
            **self._punctuality.frames(),
            "unknown_commands": self.inbox.unknown,
        }

    def _answers_frame(self, slot: Slot, tick: int) -> bool:
        if not slot.fresh:
            return False
        return slot.tick is None or slot.tick == tick or not self.clock.lockstep

    def _first_command(self, slot: Slot) -> None:
        if not self._wait(lambda: slot.fresh, self._announced + self._patience.begin, EGO_NAME):
            detail = f"no command within {self._patience.begin:g} s of the announcement"
            raise PeerError(End.PEER_SILENT.value, detail)
        self._begun = (slot.arrived or self._announced) - self._announced
        self._settle()

    def _check_silence(self, slot: Slot, tick: int) -> None:
        """Name a peer that is there and says nothing; one that has gone is given its time to come back."""
        patience = self._patience.silence
        if slot.arrived is None and self._patience.at_once:
            patience = max(patience, self._patience.begin)  # it may be planning
        since = slot.arrived if slot.arrived is not None else self.clock.due(0)
        if monotonic() - since > patience and not self._has_gone(slot):
            detail = f"no command for {patience:g} s at tick {tick}"
            raise PeerError(End.PEER_SILENT.value, detail)

    def _hear_out(self, slot: Slot, car: str, tick: int) -> None:
        """Put the last tick off until a peer that seems to have gone speaks, or is named: no later tick could name it.

        Where the world is streamed its time goes on meanwhile, for programs that drive by that time.
        """
        with self._standing_still():
            self._running = self._stream is None
            while not self._wait(lambda: slot.fresh, monotonic() + AGAIN + IDLE, car):
                self._check_silence(slot, tick)
            self._running = True

    def _has_gone(self, slot: Slot) -> bool:
        """Look whether the peer that does not answer has gone: a busy machine may not have told yet."""
        if self._looks is not None:
            self._looks.look()
        return slot.gone_since is not None

    def _wait(self, done: Callable[[], bool], until: float, car: str | None, *, still: bool = False) -> bool:
        """Wait for `done` until then, streaming in between; return whether it came. Faults of `car` end it."""
        inbox = self.inbox
        again = math.inf if still else self._repeats()
        sent_again = monotonic() + again
        while True:
            with inbox.condition:
                self._check(car)
                if done():
                    return True
                now = monotonic()
                pause = min(until, now + IDLE, self._wake(still)) - now if now < until else 0.0
                if self._polled is None and pause > 0.0:
                    inbox.condition.wait(pause)
            if self._polled is not None:
                self._polled.receive(pause)
            now = monotonic()
            if now >= until and not done():
                self._check(car)
                return False
            if self._streams(still) and now >= self._next_view:
                self._show(onward(self._state, self._elapsed(now)), self._elapsed(now), now)
            if now >= sent_again or (again < math.inf and inbox.returned > self._returned):
                if self.transport.tagged:
                    again = max(again, min(2.0 * again, AGAIN))
                sent_again = now + again
                self._returned, self._repeated = inbox.returned, True
                self._send_again()

    def _repeats(self) -> float:
        """Return after how many seconds a frame that is waited for is sent again; who comes back is sent it at once.

        Where answers say not what they answer that is frame 0 alone, for those who were not listening yet.
        """
        if not self._running or (self._moving and not self.clock.lockstep):
            return math.inf
        if self.transport.tagged:
            return self.transport.again if isinstance(self.transport, Loses) else AGAIN
        return IDLE if self._tick == 0 else NEVER_BY_ITSELF

    def _check(self, car: str | None) -> None:
        stopped = self.inbox.stopped
        if stopped is not None:
            raise PeerError(stopped[0].value, stopped[1])
        if car is None:
            return
        slot = self.inbox.slot(car)
        if slot.fault is not None:
            raise PeerError(slot.fault[0].value, slot.fault[1])
        if slot.gone_since is not None and monotonic() - slot.gone_since > self._patience.absence:
            raise PeerError(End.PEER_LOST.value, f"its peer has gone, at tick {self._tick}")

    def _streams(self, still: bool) -> bool:
        """Tell whether views between frames are sent now: in lockstep only of a world that nobody drives."""
        if self._stream is None or still:
            return False
        return not self._running or not self.clock.lockstep or not self._moving

    def _wake(self, still: bool) -> float:
        return self._next_view if self._streams(still) else math.inf

    def _elapsed(self, now: float) -> float:
        """Simulated seconds since the frame last sent, while time runs."""
        if not self._moving or self.clock.lockstep:
            return 0.0
        period = self._instance.problem.period
        wall = self.clock.due(self._tick + 1) - self.clock.due(self._tick)
        return min(period, max(0.0, (now - self._sent) * period / wall))

    def _settle(self) -> None:
        """Let surplus answers to a frame that was shown twice arrive, where answers do not name their frame."""
        self._repeated = False
        if self.clock.lockstep and not self.transport.tagged:
            self._wait(lambda: False, monotonic() + self._patience.settle, None, still=True)

    def _pass_time(self, due: float, state: State) -> None:
        """Wait until the frame `state` is due, streaming what lies between it and the frame before."""
        while True:
            now = monotonic()
            if now >= due:
                return
            if self._stream is not None and now >= self._next_view:
                share = self._elapsed(now) / self._instance.problem.period
                self._show(between(self._state, state, share), self._elapsed(now), now)
                now = monotonic()
            wake = min(due, self._next_view) if self._stream is not None else due
            with self.inbox.condition:
                self._check(None)
                if self._polled is None and wake > now:
                    self.inbox.condition.wait(wake - now)
            if self._polled is not None:
                self._polled.receive(wake - now)

    def _halt(self) -> None:
        """Let time stand still while the world is paused."""
        if not self.inbox.paused:
            return
        with self._standing_still():
            self.idle(lambda: not self.inbox.paused)
            self._settle()

    @contextmanager
    def _standing_still(self) -> Generator[None]:
        began = monotonic()
        self._moving = False
        yield
        self._moving = True
        self.clock.shift(monotonic() - began)

    def _slip(self, due: float) -> None:
        """Note how late the frame is; if by more than a tick, what is to come is put off instead of hurried."""
        if self.clock.lockstep:
            return
        behind = monotonic() - due
        if self._punctuality.slip(behind, self.clock.due(1) - self.clock.due(0)):
            self.clock.shift(behind)

    def _send(self) -> None:
        self.inbox.stale()
        self._send_new()

    def _send_new(self) -> None:
        self._returned, self._repeated = self.inbox.returned, False
        self._sent = monotonic()
        self._send_again()

    def _send_again(self) -> None:
        self._next_view = monotonic() + self._interval
        self.transport.frame(self._view(self._state, 0.0, self._sights.observe))

    def _show(self, state: State, elapsed: float, now: float) -> None:
        self._next_view = max(self._next_view + self._interval, now)
        if self._stream is not None:
            self._stream.stream(self._view(state, elapsed, lambda car: self._sights.sense(car, state)))

    def _view(self, state: State, elapsed: float, observe: Callable[[int], Observation]) -> View:
        time = self._tick / self._instance.problem.rate + elapsed
        return View(self._tick, time, state, self._labels, observe, self._running)


SIGHT = 1e150
"""Sensing radius of remote e-agents, metres: they see everything."""


def kept(state: State, labels: Labels) -> tuple[State, Labels]:
    """Return copies of arrays that belong to others and change with the next tick."""
    return State(*(column.copy() for column in state)), Labels(*(row.copy() for row in labels))


def between(before: State, after: State, share: float) -> State:
    """Return the state at `share` (0 to 1) of the way from one frame to the next.

    Within a tick of 1/30 s the chord of a car's arc is less than 0.1 mm from it.
    """
    x, y, c, s = (
        first + share * (last - first)
        for first, last in (
            (before.x, after.x),
            (before.y, after.y),
            (before.c, after.c),
            (before.s, after.s),
        )
    )
    length = np.hypot(c, s)
    return State(x, y, c / length, s / length, after.speed, after.yaw_rate, after.count)


def onward(before: State, seconds: float) -> State:
    """Return where the cars are `seconds` after a frame if they go on as they are."""
    if seconds <= 0.0:
        return before
    way, turn = before.speed * seconds, before.yaw_rate * seconds
    cosine, sine = np.cos(turn), np.sin(turn)
    c, s = before.c * cosine - before.s * sine, before.s * cosine + before.c * sine
    half_c, half_s = before.c + c, before.s + s
    length = np.hypot(half_c, half_s)
    x, y = before.x + way * half_c / length, before.y + way * half_s / length
    return State(x, y, c, s, before.speed, before.yaw_rate, before.count)


class CarViews:
    """What each car of one trial sees."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._senses: dict[int, Senses] = {}

    def take(self, tick: int, state: State, labels: Labels, observe_ego: Callable[[], Observation]) -> None:
        """Take the next frame; `own` returns the ego's observation of it."""
        self._tick, self._state, self._labels, self._observe_ego = tick, state, labels, observe_ego
        self._seen: dict[int, Observation] = {}

    def observe(self, car: int) -> Observation:
        """Return the observation of `car` in the present frame; the ego's is the trial's own."""
        if car == EGO:
            return self._observe_ego()
        if car not in self._seen:
            self._seen[car] = self.sense(car, self._state)
        return self._seen[car]

    def sense(self, car: int, state: State) -> Observation:
        """Return what `car` sees in `state`, which lies between the present frame and the next."""
        if car not in self._senses:
            self._senses[car] = Senses(self._instance, car, None if car == EGO else SIGHT)
        return self._senses[car].observe(self._tick, state, self._labels)


class RemoteController:
    """The ego's driver, elsewhere (a `protocols.Controller`)."""

    def __init__(self, link: Link) -> None:
        self._link = link

    def start(self, problem: Problem) -> None:  # noqa: ARG002  # the link has the whole instance
        """Announce the problem and wait for the first command: the time to begin."""
        self._link.announce()

    def act(self, observation: Observation) -> Command:
        """Return the command that answers the frame just shown."""
        return Command(*self._link.command(EGO_NAME, observation.tick))


class LocalController:
    """A controller in this process of a trial that others see or drive in: its link learns when the trial begins."""

    def __init__(self, link: Link, controller: Controller) -> None:
        self._link, self._controller = link, controller
        self.act = controller.act

    def start(self, problem: Problem) -> None:
        """Start the controller, then the trial."""
        self._controller.start(problem)
        self._link.announce()

    def report(self) -> Sequence[tuple[str, str]]:
        """Return what the controller has to say."""
        return self._controller.report() if isinstance(self._controller, Reports) else ()

    def close(self) -> None:
        """Close the controller if it wants to be closed."""
        if isinstance(self._controller, Closes):
            self._controller.close()


class RemoteAgents:
    """The e-agents of kind `remote`, elsewhere (a `protocols.Driver`).

    Whatever a peer does wrong is an `agent_fault` that begins with the car's name and the name of the fault.
    """

    def __init__(self, link: Link) -> None:
        self._link = link

    def __deepcopy__(self, memo: object) -> Self:
        """Refuse: a program elsewhere drives in one trial at a time."""
        raise InputError(
            "a program elsewhere can't go on in two trials",
            field="e-agents",
            value=[name for _, name in self._cars],
            expected="e-agents of types of ours, to fork a trial",
        )

    def reset(self, instances: Sequence[Instance], state: State) -> None:  # noqa: ARG002  # nothing to begin with
        """Note which cars these are; a link drives one trial at a time."""
        (instance,) = instances
        self._cars = [(n, agent.name) for n, agent in enumerate(instance.e_agents, start=1) if agent.kind == REMOTE]

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:  # noqa: ARG002
        """Write the commands of the remote e-agents."""
        self._link.announce()
        for n, car in self._cars:
            try:
                commands[0, n] = self._link.command(car, tick)
            except PeerError as error:
                if error.reason in _OF_ALL:
                    raise
                raise PeerError(End.AGENT_FAULT.value, f"{car}: {error.reason}: {error.detail}") from error


_OF_ALL = frozenset({End.RESET, End.TRANSPORT_LOST, End.WORLD_LOST, End.INTERRUPTED})
