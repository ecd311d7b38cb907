"""The seams: the protocols of simulators, drivers, controllers, sinks, watchers, transports and clocks.

Rooms above depend on these protocols alone, never on more of what implements them.

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
from dubins_traffic.record.wall import Wall

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
    "Link",
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
    """What a simulator can do.

    `batched`: it steps many trials at once. `deterministic`: equal seeds give equal bytes. `lockstep`: it waits for
    the commands of every tick. `forks`: a deep copy of it goes on from the present frame exactly as the original
    would, and shares no state with it.
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
        """Place the cars of a batch; return the simulator's state, (B, N) arrays that `step` updates in place."""
        ...

    def step(self, commands: Floats) -> Sequence[Sequence[Contact]]:
        """Clip `commands` (B, N, 2: speed, yaw rate) in place, move for one tick, return each trial's contacts."""
        ...

    def close(self) -> None:
        """Free the simulator's resources."""
        ...


@runtime_checkable
class Scans(Protocol):
    """A simulator that measures laser ranges itself; for others, ranges are computed from the state."""

    def scan(self, car: int, rays: Floats, longest: float) -> Floats:
        """Return how far each ray goes before it meets a body: (R,), metres, `longest` where it meets none.

        `rays` (R, 2) are unit vectors in the frame of `car`, from its centre; no ray meets that car.
        """
        ...


class Driver(Protocol):
    """Drives some of the cars of a batch: the built-in e-agents, or cars of another process.

    A fork of a trial goes on with a deep copy of each driver. A driver that can't be copied raises InputError in
    `__deepcopy__`.
    """

    def reset(self, instances: Sequence[Instance], state: State) -> None:
        """Begin a batch whose first frame is `state`, (B, N) arrays."""
        ...

    def decide(self, tick: int, state: State, labels: Labels, commands: Floats) -> None:
        """Write the commands of this driver's cars for [t_k, t_k+1) into `commands` (B, N, 2)."""
        ...


@runtime_checkable
class Draws(Protocol):
    """A driver that draws random numbers; they follow from the seed of the instance."""

    def reseed(self, seed: int) -> None:
        """Draw from another seed from now on; what has been drawn before stays."""
        ...


@runtime_checkable
class Forks(Protocol):
    """A sink that may go on in a fork of its trial as a deep copy; a fork leaves out all other sinks."""

    @property
    def forks(self) -> bool:
        """Whether a deep copy of the sink holds all it has received and shares no state with it."""
        ...


class Controller(Protocol):
    """Drives the ego. A class with these methods whose constructor takes no arguments; see also `Closes`, `Reports`."""

    def start(self, problem: Problem) -> None:
        """Prepare for the problem; the wall-clock time of this call is the *time to begin*."""
        ...

    def act(self, observation: Observation) -> Command | tuple[float, float] | None:
        """Return speed (m/s) and yaw rate (rad/s) for the coming tick; None gives up and ends the trial."""
        ...


@runtime_checkable
class Closes(Protocol):
    """A controller that is told when its trial is over."""

    def close(self) -> None:
        """Free the controller's resources; called once, after the trial has ended."""
        ...


@runtime_checkable
class Reports(Protocol):
    """A controller or driver that reports what it does; its reports become events in the record.

    Reports of a controller are events of the ego; reports of a driver are events of no car.
    """

    def report(self) -> Sequence[tuple[str, str]]:
        """Return (kind, detail) of each thing to report since the last call.

        It is called after every `act` or `decide`, and of drivers also after `reset`.
        """
        ...


class Watcher(Protocol):
    """Is shown every frame of a trial as soon as it is reached, before any driver decides; a Sink gets blocks."""

    def begin(self, instance: Instance) -> None:
        """Begin a trial whose cars have been placed; `watch` with frame 0 follows."""
        ...

    def watch(
        self,
        tick: int,
        state: State,
        labels: Labels,
        contacts: Sequence[Contact],
        observe: Callable[[], Observation],
    ) -> None:
        """Look at frame `tick`, just reached; the arrays (1, N) are the simulator's own and change in the next tick.

        `contacts` are those of the tick that led there, `at_fault` filled in. `observe` returns the ego's observation
        of this frame; it is made once, however often it is called.

        Raises
        ------
        ControllerError
            To end the trial for a named reason.
        """
        ...


@dataclass(frozen=True, slots=True)
class View:
    """One frame as a transport sends it; valid only until the method that receives it returns.

    `time` is in simulated seconds; `state` and `labels` hold every car of the trial, (1, N). `observe(n)` returns
    car n's own observation, as a controller in this process would get it; it is made once per frame and car.
    `running` is false while the cars are only shown and no car is driven.
    """

    tick: int
    time: float
    state: State
    labels: Labels
    observe: Callable[[int], Observation]
    running: bool


class Mailbox(Protocol):
    """Receives what arrives at a transport. Any thread may call its methods; none of them blocks, queues or raises."""

    def command(self, car: str, speed: float, yaw_rate: float, tick: int | None = None) -> None:
        """Take a command for `car`: `speed` (m/s), `yaw_rate` (rad/s); `tick` is the frame that it answers, if known.

        Numbers that are not finite are passed on as the fault of that car's driver. Commands for unknown cars are only
        counted.
        """
        ...

    def fault(self, car: str, end: End, detail: str) -> None:
        """Take note that the peer of `car` made a fault that ends its driving, such as `End.PEER_GARBAGE`."""
        ...

    def joined(self, car: str) -> None:
        """Take note that a peer of `car` has connected, or connected again."""
        ...

    def left(self, car: str) -> None:
        """Take note that the last peer of `car` has gone; it may come back within the link's patience."""
        ...

    def stop(self, end: End, detail: str) -> None:
        """End the running trial, if there is one, for a reason that is not a single peer's."""
        ...

    def pause(self, paused: bool) -> None:
        """Stop simulated time, or let it go on."""
        ...

    def place(self, car: str, pose: Pose) -> None:
        """Put `car` at `pose` if no trial is running; during a trial only drivers move cars."""
        ...


class Transport(Protocol):
    """Carries frames to drivers in other processes and commands back; one transport serves a whole session.

    All methods are called from the trial's thread, in the order open, (begin, frame..., announce, frame..., end)...,
    close. What arrives goes to the mailbox, in the thread in which it arrives.
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
        """Begin to listen; raise InputError or TransportError if that is impossible."""
        ...

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:
        """Show the world of `instance` to peers; commands are expected for the cars named in `remote`."""
        ...

    def announce(self, instance: Instance) -> None:
        """Send the problem to the peers: the trial begins. The *time to begin* counts from here."""
        ...

    def frame(self, view: View) -> None:
        """Send a frame to all peers without waiting for any: what can't be sent at once is dropped."""
        ...

    def end(self, ending: Ending) -> None:
        """Tell the peers that the trial is over, and why."""
        ...

    def close(self) -> None:
        """Close all connections and free all resources; may be called twice."""
        ...


@runtime_checkable
class Streams(Protocol):
    """A transport that also sends the world between two ticks, as wall-clock time passes."""

    @property
    def interval(self) -> float:
        """Wall-clock seconds between two views."""
        ...

    def stream(self, view: View) -> None:
        """Send the world between two frames: `view.time` and `view.state` are interpolated between those of ticks."""
        ...


@runtime_checkable
class Polled(Protocol):
    """A transport without threads of its own: the trial's thread receives messages while it waits.

    Handing a message over from another thread would cost about as much as a whole exchange of messages.
    """

    def receive(self, seconds: float) -> None:
        """Wait at most `seconds` for a message, and hand all that have arrived to the mailbox."""
        ...


@runtime_checkable
class Looks(Protocol):
    """A transport that finds peers by polling: now and then, and once more before a peer is declared silent."""

    def look(self) -> None:
        """Tell the mailbox which peers have connected and which have gone since the last look."""
        ...


class Link(Watcher, Protocol):
    """One trial's connection to drivers in other processes: it shows them frames, and stands for them in the trial."""

    @property
    def ego(self) -> bool:
        """Whether the ego is driven elsewhere."""
        ...

    @property
    def name(self) -> str:
        """Name of the transport; stands in the record as the controller's if the ego is driven elsewhere."""
        ...

    def controller(self) -> Controller:
        """Return the ego's driver elsewhere."""
        ...

    def beside(self, controller: Controller) -> Controller:
        """Return `controller`, of this process, as one whose start tells the programs elsewhere that a trial begins."""
        ...

    def agents(self) -> Driver:
        """Return the driver of the e-agents that are driven elsewhere."""
        ...

    def finish(self, ending: Ending) -> None:
        """Tell the programs elsewhere that the trial is over."""
        ...

    def completed(self, measured: Wall) -> Wall:
        """Return the wall-clock figures of the trial with those of the link."""
        ...


class Clock(Protocol):
    """Says when frames are due and how long to wait for commands; times are those of `time.monotonic`, seconds."""

    @property
    def lockstep(self) -> bool:
        """Whether the simulation waits for the command of every tick; then every due time is in the past."""
        ...

    def start(self, period: float, now: float) -> None:
        """Begin simulated time 0 at `now`; a tick takes `period` simulated seconds."""
        ...

    def due(self, tick: int) -> float:
        """Return the time at which frame `tick` is to be sent."""
        ...

    def until(self, tick: int, now: float) -> float:
        """Return the time until which to wait for the commands that answer frame `tick`."""
        ...

    def shift(self, seconds: float) -> None:
        """Delay all due times by `seconds`: the trial was paused, or the machine was suspended."""
        ...
