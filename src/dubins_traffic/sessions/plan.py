"""Plans of sessions over a transport, from a configuration, an instance or a record.

Unlike the jobs of a run (`runs.plan`), the trials of a session are drawn one after another, and share one connection.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from time import monotonic

import numpy as np

from dubins_traffic.cars.state import State
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.controllers.scripted import Scripted
from dubins_traffic.errors import InputError
from dubins_traffic.files import locked
from dubins_traffic.observations.senses import Senses
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import OUTSIDE, Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.problem.parts import Laser
from dubins_traffic.protocols import Clock, Controller, Simulator, Transport
from dubins_traffic.record.reader import Record
from dubins_traffic.runs.plan import check_data_file, concluded, load_runnable
from dubins_traffic.runs.record_folder import Earlier, check_choice, check_folder, claim
from dubins_traffic.runs.single import Result, run_trial
from dubins_traffic.scoring.score import ScoreSheet
from dubins_traffic.sessions.remote import Session, hand_over, itself, quiet, run_remote, run_under
from dubins_traffic.transports.clocks import Lockstep, Patience, RealTime
from dubins_traffic.transports.link import Link
from dubins_traffic.transports.maestro import ForeignMaestro, Maestro

SOON = 1.0
"""Seconds after which is told that something is compiled."""
REHEARSAL = 1.2
"""Duration of the trial that `rehearse` runs, seconds: more than a block of frames."""


@dataclass(frozen=True, slots=True)
class Pace:
    """The pace of a session: its clock, and how long drivers are waited for.

    InputError if a value is out of range.
    """

    lockstep: bool = False
    """Whether the simulation waits for a command of every remote car in each tick; otherwise it runs in real time."""
    factor: float = 1.0
    """Speed of simulated time relative to the wall clock, in real time."""
    deadline: float = 5.0
    """Seconds within which a command must come in lockstep."""
    patience: Patience = field(default_factory=Patience)
    """How long peers are waited for otherwise."""

    def __post_init__(self) -> None:
        """Refuse values of which no clock can be made, before a transport is opened."""
        self.clock()

    def clock(self) -> Clock:
        """Return a clock of this pace."""
        return Lockstep(self.deadline) if self.lockstep else RealTime(self.factor)


@dataclass(frozen=True, slots=True)
class SessionPlan:
    """What a session runs: the source of its instances, the number of trials, and where results are written.

    `trials` is None for an endless session. `controller` is None if another process drives the ego. `shield` tells
    whether the ego drives under the shield. `say` is called with lines for people on what the session does and waits
    for. `overwrite` and `append` decide about existing records (`claim`); `earlier` is what those are.
    """

    supply: Callable[[int], Instance]
    trials: int | None
    configuration: Configuration | None
    controller: str | None
    remote: tuple[str, ...]
    records: Path | None
    data: Path | None
    shield: bool = False
    overwrite: bool = False
    append: bool = False
    earlier: Earlier = field(default_factory=Earlier)
    say: Callable[[str], None] = quiet
    began: datetime = field(default_factory=lambda: datetime.now(UTC))

    def claim(self, transport: str) -> SessionPlan:
        """Return this plan for the transport of that name, after preparing the folder for records.

        InputError if the folder holds records that are neither to be removed nor of this session; see
        `record_folder.claim`.
        """
        if self.records is None:
            return self
        driver = self.controller or (controllers.shielded(transport) if self.shield else transport)
        kept = claim(self.records, driver, self._instance, overwrite=self.overwrite, append=self.append, placed=True)
        earlier = Earlier.of(self.records, kept)
        if earlier.over:
            self.say(f"{len(earlier.over)} trials have their records in {self.records}, and are not run again")
        return replace(self, earlier=earlier)

    def _instance(self, number: int) -> Instance:
        return hand_over(self.supply(number), self.remote)

    def run(
        self,
        transport: Transport,
        pace: Pace,
        maestro: Maestro | None,
        world: Callable[[], tuple[Simulator, Callable[[Instance], Instance]]] | None = None,
        at: Callable[[], str] | None = None,
        foreign: ForeignMaestro | None = None,
    ) -> Iterator[Result]:
        """Run the session over `transport`, which is closed in any case; see `remote.run_remote`.

        Once the transport is open, `world` makes the simulator, in place of the one that instances name, with what
        describes its disturbances, and `at` returns a line for people with the transport's address. `foreign`, if
        given, starts and ends the trials; see `remote.run_under`.
        """
        held = ExitStack()
        try:
            if self.records is not None:
                held.enter_context(locked(self.records))
            patience = replace(pace.patience, at_once=foreign is not None)
            link = Link(transport, pace.clock(), ego=self.controller is None, patience=patience)
            if at is not None:
                self.say(at())
            simulator, described = (None, itself) if world is None else world()
            session = Session(
                link,
                self.supply,
                self.trials,
                maestro,
                self.controller or (controllers.SHIELDED if self.shield else ""),
                self.remote,
                self.records,
                self.earlier,
                simulator,
                self.say,
                described,
            )
            if foreign is None:
                yield from run_remote(session)
            else:
                yield from run_under(session, foreign, self.shortest)
        finally:
            transport.close()
            held.close()

    @property
    def shortest(self) -> float:
        """The shortest duration that a trial may have, seconds."""
        settings = None if self.configuration is None else self.configuration.settings
        if settings is None:
            return self.supply(0).duration
        return float(settings.duration_bounds[0] if settings.duration is None else settings.duration)

    def over(
        self,
        transport: Transport,
        pace: Pace,
        maestro: Maestro | None = None,
        at: Callable[[], str] | None = None,
    ) -> Iterator[Result]:
        """Claim the folder, compile and run: all of a session over a transport that needs nothing else.

        Parameters
        ----------
        transport : Transport
            The transport, not yet open; it is closed at the end.
        pace : Pace
            The clock, and how long drivers are waited for.
        maestro : Maestro, optional
            Starts every trial; without one each trial begins when the one before is over.
        at : callable, optional
            Returns a line for people with the transport's address, once that is open.
        """
        claimed = self.claim(transport.name)
        claimed.rehearse()
        yield from claimed.run(transport, pace, maestro, at=at)

    def rehearse(self) -> None:
        """Compile the kernels that trials need, before drivers wait for them."""
        began = monotonic()
        late = threading.Timer(
            SOON, self.say, ["compiling what trials need; the first time on a machine takes minutes"]
        )
        late.start()
        try:
            rehearse(self.supply(0), shield=self.shield)
        finally:
            late.cancel()
            late.join()
        if monotonic() - began > SOON:
            self.say(f"compiled, after {monotonic() - began:.1f} s")

    def conclude(self, results: Sequence[Result]) -> ScoreSheet:
        """Return the scores, and write the trial data file if one was asked for."""
        return concluded(results, self.configuration, self.data, self.began)


def session_plan(
    source: str | os.PathLike[str],
    controller: str | None = None,
    *,
    trials: int | None = None,
    endless: bool = False,
    seed: int | None = None,
    rnd: str | os.PathLike[str] | None = None,
    remote: Sequence[str] = (),
    data: str | os.PathLike[str] | None = None,
    overwrite_data: bool = False,
    records: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    append: bool = False,
    shield: bool = False,
) -> SessionPlan:
    """Return the plan of a session, with everything checked that can be checked before the transport is opened.

    Parameters
    ----------
    source : path or str
        A trials configuration (file or shipped name), an instance or a record.
    controller : str, optional
        Drives the ego in this process; by default another process drives it.
    trials : int, optional
        Number of trials of a configuration; by default as many as it says.
    endless : bool
        Whether trials follow each other until the session is interrupted.
    seed : int, optional
        Seed of a configuration's trials, or of an instance document without one; 0 by default.
    rnd : path, optional
        A road network that replaces the configuration's.
    remote : sequence of str
        Names of e-agents that other processes drive, whatever their type says.
    data : path, optional
        File for the trial data of a configuration; refused if it exists unless `overwrite_data`.
    records : path, optional
        Folder for the records, made if missing. One that holds records is refused, unless one of the following.
    overwrite : bool
        Whether to remove the records that the folder holds first.
    append : bool
        Whether to keep the records that the folder holds and run only the other trials; they must be of the same
        driver and instances.
    shield : bool
        Whether the ego drives under the shield (`controllers.shield`), whatever process drives it.

    Raises
    ------
    InputError
        If an argument or the source is wrong; nothing has been written then.
    """
    check_choice(records, data, overwrite=overwrite, append=append)
    runnable = load_runnable(source, rnd=rnd, seed=seed or 0)
    if controller is not None:
        controller = controllers.shielded(controller) if shield else controller
        controllers.load(controller)
    if trials is not None and (trials < 1 or endless):
        raise InputError("not a number of trials", file="--trials", value=trials, expected="at least 1, or --endless")
    supply = _supply(runnable, seed or 0)
    hand_over(supply(0), remote)
    configuration = runnable if isinstance(runnable, Configuration) else None
    if data is not None and configuration is None:
        raise InputError("is for configurations", file="-f", value=os.fspath(data), expected="none of it here")
    count = trials or (1 if configuration is None else configuration.number_trials)
    return SessionPlan(
        supply,
        None if endless else count,
        configuration,
        controller,
        tuple(remote),
        None if records is None else check_folder(records),
        None if data is None else check_data_file(Path(data), overwrite_data, source, configuration),
        shield,
        overwrite,
        append,
    )


def rehearse(instance: Instance, *, shield: bool = False) -> None:
    """Run about a second of `instance` without drivers, so that all kernels are compiled before time counts.

    The ego drives under the shield if `shield`, and every laser sweeps once, as for a peer that receives scans. Cars of
    a world outside are not told to move yet: embedded ones move in their place.
    """
    agents = tuple(
        replace(agent, kind="scripted", parameters={"commands": [], "repeat": False}) if agent.kind == REMOTE else agent
        for agent in instance.e_agents
    )
    simulator = "embedded" if instance.simulator in OUTSIDE else instance.simulator
    duration = min(instance.duration, REHEARSAL)
    brief = replace(instance, e_agents=agents, duration=duration, simulator=simulator)
    nobody: Controller = Scripted(np.zeros((brief.ticks, 2)))
    run_trial(brief, controllers.under_shield(nobody) if shield else nobody)
    state = State.zeros(1, len(brief.starts))
    Senses(brief, laser=brief.problem.laser or Laser()).sweep(state)


def moved_by(supply: Callable[[int], Instance], simulator: str, number: int) -> Instance:
    """Return instance `number` of `supply`, with `simulator` as its simulator."""
    return replace(supply(number), simulator=simulator)


def _supply(runnable: Configuration | Instance | Record, seed: int) -> Callable[[int], Instance]:
    if isinstance(runnable, Configuration):
        configuration = runnable
        return lambda number: draw(configuration, seed, number)
    instance = runnable.instance if isinstance(runnable, Record) else runnable
    return lambda _number: instance
