"""Runs trials in which other processes drive the ego or some of the e-agents, under our maestro or another one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import count
from pathlib import Path
from typing import Any

from dubins_traffic.cars.state import Frames, Pose
from dubins_traffic.errors import InputError, PeerError, TransportError
from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.problem.files import parse_json
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import Controller, End, Ending, Simulator, Sink
from dubins_traffic.record import wall
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.runs.record_folder import Earlier
from dubins_traffic.runs.single import Result, Trial, run_trial
from dubins_traffic.scoring.score import Scorer
from dubins_traffic.transports.link import Link
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro, Next, Phase


def itself(instance: Instance) -> Instance:
    """Return an instance as it is: of worlds that have no disturbances of their own."""
    return instance


def quiet(_line: str) -> None:
    """Do nothing: for sessions without lines for people."""


@dataclass(frozen=True, slots=True)
class Session:
    """A session over a transport."""

    link: Link
    """Connects to the drivers in other processes."""
    supply: Callable[[int], Instance]
    """Returns instance number n; called with 0, 1, 2, ... as instances are drawn."""
    trials: int | None = 1
    """Number of trials after which the session ends; None: never."""
    maestro: Maestro | None = None
    """Starts every trial; without one each trial starts when the one before is over."""
    controller: str | Controller = "lanes"
    """Drives the ego if the link does not."""
    remote: tuple[str, ...] = ()
    """Names of e-agents that other processes drive, whatever their type says."""
    records: Path | None = None
    """Folder for records: ``trial-0000.mcap`` for instance 0, ``trial-0000-1.mcap`` for its first repetition."""
    earlier: Earlier = field(default_factory=Earlier)
    """How far an earlier session has come: its ended trials count, and are not run again."""
    simulator: Simulator | None = None
    """Replaces the simulator that instances name."""
    say: Callable[[str], None] = quiet
    """Called with lines for people on what the session does and waits for."""

    described: Callable[[Instance], Instance] = itself
    """Returns an instance with the disturbances of a world outside."""

    def which(self, instance: Instance, done: int) -> str:
        """Return the words for the trial of `instance`, which follows `done` others."""
        return f"trial {instance.trial}" + ("" if self.trials is None else f" ({done + 1} of {self.trials})")


def run_remote(session: Session) -> Iterator[Result]:
    """Run the trials of `session` and yield their results, including those of trials that were restarted.

    A trial that ends by a peer's fault is a result like any other, and the next one follows. The link is left open.

    TransportError if the transport is lost; after the result of the trial that was running; InputError if an instance
    has no e-agent of a name in `remote`.
    """
    maestro = session.maestro
    session.link.inbox.warn = session.say
    try:
        if maestro is not None:
            session.link.mark = lambda running: maestro.enter(Phase.RUNNING if running else Phase.PREPARING)
        yield from _trials(session)
    finally:
        if maestro is not None:
            maestro.close()


def _trials(session: Session) -> Iterator[Result]:
    """Run one trial after another."""
    earlier = session.earlier
    done, number, repetition = len(earlier.over), -1, 0
    instance: Instance | None = None
    while session.trials is None or done < session.trials:
        if instance is None:
            number = next(later for later in count(number + 1) if later not in earlier.over)
            repetition = earlier.runs.get(number, 0)
            instance = session.described(hand_over(session.supply(number), session.remote))
        which = session.which(instance, done)
        asked, instance = _await_start(session, instance, which)
        if asked is Next.DRAW:
            instance = None
            continue
        ego = "; the first command of ego is waited for" if session.link.ego else ""
        session.say(f"{which}: begins{ego}")
        yield run_trial(
            instance,
            session.controller,
            record=record_path(session.records, number, repetition),
            overwrite=True,
            link=session.link,
            simulator=session.simulator,
        )
        check_lost(session.link)
        if session.maestro is not None and session.maestro.next is Next.REPEAT:
            repetition += 1
        else:
            done, instance = done + 1, None


def check_lost(link: Link) -> None:
    """Raise TransportError if the transport has been lost."""
    lost = link.inbox.stopped
    if lost is not None and lost[0] is End.TRANSPORT_LOST:
        raise TransportError(lost[1])


def hand_over(instance: Instance, remote: Iterable[str]) -> Instance:
    """Return `instance` with the e-agents named in `remote` made remote.

    InputError if it has no e-agent of one of these names.
    """
    wanted = set(remote)
    for name in sorted(wanted - set(instance.names[1:])):
        expected = f"one of {', '.join(instance.names[1:21])}" if instance.e_agents else "an instance with e-agents"
        raise InputError("no such e-agent", file="--remote", value=name, expected=expected)
    agents = tuple(
        replace(agent, kind=REMOTE, type=REMOTE, parameters={}) if agent.name in wanted else agent
        for agent in instance.e_agents
    )
    return replace(instance, e_agents=agents)


def _await_start(session: Session, instance: Instance, which: str) -> tuple[Next, Instance]:
    """Show the world until a peer starts the trial or asks for another; return the instance with its cars as placed."""
    maestro, link = session.maestro, session.link
    if maestro is None:
        return Next.RUN, instance
    inbox = link.inbox
    maestro.interrupt = lambda detail: inbox.stop(End.RESET, detail) if detail else inbox.wake()
    maestro.enter(Phase.PREPARING)
    inbox.placed()
    try:
        while True:
            with Trial(instance, simulator=session.simulator, link=link):
                if maestro.phase is Phase.PREPARING:
                    session.say(f"{which}: waiting for READY and START from the program that drives ego")
                    maestro.enter(Phase.READY)
                link.idle(lambda: maestro.next is not None or inbox.news)
            instance = placed(instance, inbox.placed())
            if maestro.next is not None:
                break
    except PeerError as error:
        raise TransportError(error.detail) from error
    return maestro.next, instance


def placed(instance: Instance, places: Mapping[str, Pose]) -> Instance:
    """Return `instance` with cars at other starts."""
    old = zip(instance.names, instance.starts, strict=True)
    return replace(instance, starts=tuple(places.get(name, start) for name, start in old))


def record_path(folder: Path | None, number: int, repetition: int) -> Path | None:
    """Return where the record of an instance's trial stands, None where none is wanted."""
    if folder is None:
        return None
    suffix = f"-{repetition}" if repetition else ""
    return folder / f"trial-{number:04d}{suffix}.mcap"


LONGEST = 3_600.0
"""Longest duration of a trial that its maestro does not end, seconds."""
SHORT = 0.5
"""Seconds by which a trial may be shorter than the shortest duration and still count as whole."""
TOPIC = "the other maestro's problem instance"


class _KeptFrames:
    """A sink that keeps the frames of a trial until its duration is known: when the maestro ends it."""

    def __init__(self) -> None:
        self._blocks: list[Frames] = []

    def begin(self, instance: Instance) -> None:
        """Do nothing yet: the duration is unknown."""

    def frames(self, frames: Frames) -> None:
        """Keep a block."""
        self._blocks.append(frames)

    def end(self, ending: Ending) -> None:
        """Do nothing: the session sets the ending."""

    def pour(self, instance: Instance, ending: Ending, sinks: Sequence[Sink]) -> None:
        """Hand the kept frames to `sinks`, as a trial of `instance`."""
        for sink in sinks:
            sink.begin(instance)
            for block in self._blocks:
                sink.frames(block)
            sink.end(ending)


def run_under(session: Session, maestro: ForeignMaestro, shortest: float) -> Iterator[Result]:
    """Run the trials that `maestro` starts and yield their results.

    Cars, e-agents and bounds are those of the session's instances; network, goals and radius come from the maestro. A
    trial lasts until the maestro ends it, and that is its duration. A trial that the maestro ends more than half a
    second before the `shortest` duration (seconds), by the clock on the wall as maestros go by it, counts as reset: on
    a busy machine the cars may have moved for less.

    TransportError if the transport is lost; after the result of the trial that was running; InputError if an instance
    has no e-agent of a name in the session's `remote`.
    """
    link = session.link
    link.inbox.warn = session.say
    maestro.news = lambda: _look(link, maestro)
    link.mark = lambda _running: _look(link, maestro)
    done = 0
    while session.trials is None or done < session.trials:
        drawn = session.described(hand_over(session.supply(done), session.remote))
        instance = _await_problem(session, maestro, drawn, session.which(drawn, done))
        session.say(f"{session.which(instance, done)}: begins")
        kept = _KeptFrames()
        result = run_trial(instance, session.controller, sinks=[kept], link=link, simulator=session.simulator)
        whole = maestro.lasted >= shortest - SHORT
        yield _settled(result, kept, shortest, whole, record_path(session.records, done, 0))
        check_lost(link)
        done += 1


def _look(link: Link, maestro: ForeignMaestro) -> None:
    """End the running trial if the maestro has ended it; otherwise wake those who wait."""
    if link.running and maestro.over:
        link.inbox.stop(End.DURATION, "")
    else:
        link.inbox.wake()


def _await_problem(session: Session, maestro: ForeignMaestro, instance: Instance, which: str) -> Instance:
    """Show the world until the maestro sends a problem; return the instance to run."""
    link, inbox = session.link, session.link.inbox
    session.say(f"{which}: waiting for a problem instance from the other maestro")
    try:
        while True:
            with Trial(instance, simulator=session.simulator, link=link):
                link.idle(lambda: maestro.asks or inbox.news)
            instance = placed(instance, inbox.placed())
            text = maestro.take()
            if text is None:
                continue
            try:
                instance = with_problem(instance, text)
            except InputError as error:
                session.say(f"{which}: the other maestro's problem is passed over: {error}")
                continue
            return instance
    except PeerError as error:
        raise TransportError(error.detail) from error


def with_problem(instance: Instance, text: str) -> Instance:
    """Return `instance` with the network, goals and radius of the problem in `text`.

    InputError if `text` is no problem.
    """
    document = parse_json(text, TOPIC)
    more: dict[str, Any] = {"version": 1, "duration": 1.0, "e-agents": []}
    problem = instance_from_document({**document, **more}, TOPIC).problem
    radius = problem.intersection_radius
    return replace(
        instance,
        problem=replace(instance.problem, network=problem.network, goals=problem.goals, intersection_radius=radius),
        duration=LONGEST,
    )


def _settled(result: Result, kept: _KeptFrames, shortest: float, whole: bool, path: Path | None) -> Result:
    """Return the result of a trial, with the duration that is now known, and write its record.

    `whole`: whether the maestro ended it no sooner than may be.
    """
    ending = result.ending
    seconds = max(1, ending.ticks) / result.instance.problem.rate
    duration = seconds
    if ending.end is End.DURATION and not whole:
        ending = Ending(End.RESET, ending.ticks, f"the maestro ended it after {seconds:.1f} s")
    if ending.end is not End.DURATION:
        duration = max(shortest, seconds)
    instance = replace(result.instance, duration=duration)
    scorer = Scorer()
    writer = None if path is None else RecordWriter(path, controller=result.controller, overwrite=True)
    try:
        kept.pour(instance, ending, [scorer] if writer is None else [writer, scorer])
    finally:
        if writer is not None:
            writer.close()
    if path is not None:
        wall.write(path, result.wall)
    score = scorer.result(controller=result.controller, record=path, wall=result.wall)
    return replace(result, instance=instance, ending=ending, score=score, record=path)
