"""The seams: what a simulator, a driver, a controller, a sink must be. No room above may ask for more.

The order of events in a tick is that of `docs/semantics.md`: sense, decide, clip, move, label, push.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from dubins_traffic.cars.state import Command, Contact, Labels, Observation, Pose, State
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.problem.instance import Instance, Problem
from dubins_traffic.record.sink import End, Ending, Sink

__all__ = [
    "Capabilities",
    "Clock",
    "Closes",
    "Controller",
    "Draws",
    "Driver",
    "End",
    "Ending",
    "Forks",
    "Looks",
    "Mailbox",
    "Polled",
    "Reports",
    "Scans",
    "Simulator",
    "Sink",
    "Streams",
    "Transport",
    "View",
    "Watcher",
]


@dataclass(frozen=True, slots=True)
class Capabilities:
    """What a simulator can do: step many trials at once, give equal bytes for equal seeds, wait for commands.

    `forks`: a deep copy of it goes on from where it is, as it would itself, and shares nothing with it that changes.
    """

    batched: bool
    deterministic: bool
    lockstep: bool
    forks: bool = False


class Simulator(Protocol):
    """Moves the cars. One conformance suite runs on every simulator."""

    @property
    def capabilities(self) -> Capabilities:
        """What this simulator can do."""
        ...

    def reset(self, instances: Sequence[Instance]) -> State:
        """Place the cars of a batch; the returned state is this simulator's own, updated in place by `step`."""
        ...

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip `commands` (B, N, 2: speed, yaw rate) in place, move for one tick, return each trial's contacts."""
        ...

    def close(self) -> None:
        """Free what the simulator holds."""
        ...


@runtime_checkable
class Scans(Protocol):
    """A simulator with lasers of its own; for others, laser ranges are worked out from the state."""

    def scan(self, car: int, rays: Floats, longest: float) -> Floats:
        """Return how far each ray goes before it meets a body: (R,), metres, `longest` where it meets none.

        `rays` (R, 2) are unit vectors in the frame of `car`, from its centre; no ray meets that car.
        """
        ...


class Driver(Protocol):
    """Drives some of the cars of a batch (built-in e-agents; a controller made to fit).

    In a fork of a trial a deep copy of it goes on. One that can't be copied raises InputError when it is.
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a batch whose first frame is `state`."""
        ...

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of this driver's cars for [t_k, t_k+1) into `commands` (B, N, 2)."""
        ...


@runtime_checkable
class Draws(Protocol):
    """A driver whose choices are random; they follow from the seed of the instance."""

    def reseed(self, seed: int) -> None:
        """Let all that is drawn from now on follow from another seed; what has been drawn stays."""
        ...


@runtime_checkable
class Forks(Protocol):
    """A sink of which a deep copy goes on in a fork of its trial; one that does not say so stays behind."""

    @property
    def forks(self) -> bool:
        """Whether a deep copy has seen what it has seen, and shares nothing with it that changes."""
        ...


class Controller(Protocol):
    """Drives the ego. A class without arguments that has these methods; `close` may be left out."""

    def start(self, problem: Problem) -> None:
        """Learn the problem; the wall-clock time of this call is the *time to begin*."""
        ...

    def act(self, observation: Observation) -> Command | tuple[float, float] | None:
        """Choose speed (m/s) and yaw rate (rad/s) for the coming tick. None gives up."""
        ...


@runtime_checkable
class Closes(Protocol):
    """A controller that wants to know that its trial is over."""

    def close(self) -> None:
        """Free what is held."""
        ...


@runtime_checkable
class Reports(Protocol):
    """A controller or driver that has something to say of what it does; it stands in the record as events.

    Those of a controller are events of the ego, those of a driver of no car.
    """

    def report(self) -> Sequence[tuple[str, str]]:
        """Return kind and detail of what has happened since the last call.

        It is made after every `act` or `decide`, of drivers also after `reset`.
        """
        ...


class Watcher(Protocol):
    """Is shown every frame of a trial at once, before anyone decides on it; a Sink gets them in blocks."""

    def begin(self, instance: Instance) -> None:
        """A trial has been placed; its first frame follows."""
        ...

    def watch(self, tick: int, state: State, labels: Labels, observe: Callable[[], Observation]) -> None:
        """Frame `tick` has been reached; the arrays are the simulator's own and change with the next tick.

        `observe` returns the ego's observation of this frame, made once for all who ask.

        Raises
        ------
        ControllerError
            To end the trial for a named reason.
        """
        ...


@dataclass(frozen=True, slots=True)
class View:
    """One frame as a transport sends it, to be read before the method that is given it returns.

    `time` is in simulated seconds; `state` and `labels` hold every car of the trial, (1, N). `observe(n)` makes car
    n's own observation, of a frame once however often it is asked: what a controller in this process would be handed.
    `running` is false while the cars are only shown and nobody drives.
    """

    tick: int
    time: float
    state: State
    labels: Labels
    observe: Callable[[int], Observation]
    running: bool


class Mailbox(Protocol):
    """Where a transport puts what arrives. Any thread may call these; none of them waits, keeps a queue or raises."""

    def command(self, car: str, speed: float, yaw_rate: float, tick: int | None = None) -> None:
        """`car` shall drive at `speed` (m/s) and `yaw_rate` (rad/s); `tick` is the frame that this answers, if known.

        Numbers that are not finite are passed on: they are that driver's fault. Unknown cars are counted, no more.
        """
        ...

    def fault(self, car: str, end: End, detail: str) -> None:
        """The peer of `car` has done something that ends its driving, such as `End.PEER_GARBAGE`."""
        ...

    def joined(self, car: str) -> None:
        """A peer of `car` is there, or there again."""
        ...

    def left(self, car: str) -> None:
        """The last peer of `car` has gone; it may come back within the link's patience."""
        ...

    def stop(self, end: End, detail: str) -> None:
        """End the trial that is running, if one is, for a reason that is no single peer's."""
        ...

    def pause(self, paused: bool) -> None:
        """Let simulated time stand still, or go on."""
        ...

    def place(self, car: str, pose: Pose) -> None:
        """Put `car` there, if no trial runs; a running trial lets nobody move cars but their drivers."""
        ...


class Transport(Protocol):
    """Carries frames to drivers elsewhere and their commands back; one for all remote cars of a session.

    All methods are called from the trial's thread, in the order open, (begin, frame..., announce, frame..., end)...,
    close. What arrives goes to the mailbox, from whatever thread it arrives in.
    """

    @property
    def name(self) -> str:
        """Short name, such as `ros1`; stands in the record as the controller's."""
        ...

    @property
    def tagged(self) -> bool:
        """Whether commands carry the tick that they answer; without, the first after a frame is its answer."""
        ...

    def open(self, mailbox: Mailbox) -> None:
        """Begin to listen. InputError or TransportError if that can't be."""
        ...

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """The world of `instance` has been put up; commands of the cars `remote` are wanted."""
        ...

    def announce(self, instance: Instance) -> None:
        """Tell the peers the problem: the trial begins. `time to begin` counts from here."""
        ...

    def frame(self, view: View) -> None:
        """Send a frame to all peers. What can't be sent at once is dropped: never wait for a peer."""
        ...

    def end(self, ending: Ending) -> None:
        """The trial is over; tell the peers."""
        ...

    def close(self) -> None:
        """Leave nothing behind. May be called twice."""
        ...


@runtime_checkable
class Streams(Protocol):
    """A transport that sends the world more often than once a tick while wall-clock time passes."""

    @property
    def interval(self) -> float:
        """Seconds of wall clock between two views."""
        ...

    def stream(self, view: View) -> None:
        """Send the world as it is between two frames: `view.time` and `view.state` lie between those of ticks."""
        ...


@runtime_checkable
class Polled(Protocol):
    """A transport without threads of its own: what has come is taken by the trial's thread when it waits.

    Handing a message over from another thread would cost about as much as a whole exchange of messages.
    """

    def receive(self, seconds: float) -> None:
        """Wait for a message, so long at most, and hand all that have come to the mailbox."""
        ...


@runtime_checkable
class Looks(Protocol):
    """A transport that sees who is there by looking, now and then, and at once before a peer is called silent."""

    def look(self) -> None:
        """Tell the mailbox who has come and who has gone by now."""
        ...


class Clock(Protocol):
    """Says when frames are due and how long commands are waited for; times are those of `time.monotonic`."""

    @property
    def lockstep(self) -> bool:
        """Whether the simulation waits for the command of every tick; then due times are always past."""
        ...

    def start(self, period: float, now: float) -> None:
        """Simulated time 0 is now; a tick takes `period` simulated seconds."""
        ...

    def due(self, tick: int) -> float:
        """Return when frame `tick` is to be sent."""
        ...

    def until(self, tick: int, now: float) -> float:
        """Return until when the commands that answer frame `tick` are waited for."""
        ...

    def shift(self, seconds: float) -> None:
        """Move all that is to come by `seconds`: the trial was paused, or the machine stood still."""
        ...
