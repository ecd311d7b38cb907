"""Trials under a maestro in another process, which sends problems and ends trials; simulator and referee run here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import InputError, PeerError, TransportError
from dubins_traffic.problem.document import instance_from_document
from dubins_traffic.problem.files import parse_json
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End, Ending, Sink
from dubins_traffic.record import wall
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.runs.single import Result, Trial, run_trial
from dubins_traffic.scoring.score import Scorer
from dubins_traffic.sessions.remote import Session, check_lost, hand_over, placed, record_path
from dubins_traffic.transports.foreign import ForeignMaestro
from dubins_traffic.transports.link import Link

LONGEST = 3_600.0
"""Longest duration of a trial that its maestro does not end, seconds."""
SHORT = 0.5
"""Seconds by which a trial may be shorter than the shortest duration and still count as whole."""
TOPIC = "the other maestro's problem instance"


class _Kept:
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
    second before the `shortest` duration (seconds) counts as reset.

    Raises
    ------
    TransportError
        If the transport is lost; after the result of the trial that was running.
    InputError
        If an instance has no e-agent of a name in the session's `remote`.
    """
    link = session.link
    link.inbox.warn = session.say
    maestro.news = lambda: _look(link, maestro)
    link.mark = lambda _running: _look(link, maestro)
    done = 0
    while session.trials is None or done < session.trials:
        drawn = hand_over(session.supply(done), session.remote)
        instance = _await_problem(session, maestro, drawn, session.which(drawn, done))
        session.say(f"{session.which(instance, done)}: begins")
        kept = _Kept()
        result = run_trial(instance, session.controller, sinks=[kept], link=link, simulator=session.simulator)
        yield _settled(result, kept, shortest, record_path(session.records, done, 0))
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

    Raises
    ------
    InputError
        If `text` is no problem.
    """
    document = parse_json(text, TOPIC)
    more: dict[str, Any] = {"version": 1, "duration": 1.0, "e-agents": []}
    problem = instance_from_document({**document, **more}, TOPIC).problem
    radius = problem.intersection_radius
    return replace(
        instance,
        problem=replace(
            instance.problem, network=problem.network, goals=problem.goals, intersection_radius=radius
        ),
        duration=LONGEST,
    )


def _settled(result: Result, kept: _Kept, shortest: float, path: Path | None) -> Result:
    """Return the result of a trial, with the duration that is now known, and write its record."""
    ending = result.ending
    seconds = max(1, ending.ticks) / result.instance.problem.rate
    duration = seconds
    if ending.end is End.DURATION and seconds < shortest - SHORT:
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
