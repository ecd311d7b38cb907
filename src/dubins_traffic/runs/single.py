"""One trial with all its parts: the instance's simulator, the built-in e-agents, a record, a score."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from dubins_traffic.agents.late import fleet_of
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.display import Tabulated
from dubins_traffic.errors import InputError
from dubins_traffic.outside import put_back
from dubins_traffic.problem.draw import check_numbers
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.kinds import REMOTE
from dubins_traffic.protocols import Controller, Driver, Ending, Link, Simulator, Sink, Watcher
from dubins_traffic.record import wall
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.metric import MetricSpec
from dubins_traffic.scoring.score import Score, Scorer
from dubins_traffic.simulators import registry as simulators
from dubins_traffic.trial.trial import Trial as BareTrial
from dubins_traffic.trial.trial import run
from dubins_traffic.viewer.notebook import trial_html
from dubins_traffic.viewer.paths import Paths


class Trial(BareTrial):
    """A trial of one instance, stepped by its caller.

    Parameters
    ----------
    instance : Instance
        The instance to run.
    sinks : sequence of Sink
        Receive instance, frames and ending: a `RecordWriter`, a `Scorer`, or a class of your own.
    record : Path or str, optional
        File of the record to write.
    simulator : Simulator, optional
        Replaces the simulator that the instance names.
    link : Link, optional
        Connects to the drivers of remote cars.
    watchers : sequence of Watcher
        Are shown every frame at once.

    Raises
    ------
    InputError
        If an e-agent is remote and there is no link.

    Examples
    --------
    >>> import dubins_traffic as dt
    >>> trial = dt.Trial(dt.draw(dt.load_config("demo"), seed=1, trial=0))
    >>> while trial.ending is None:
    ...     observation = trial.step((0.5, 0.0))
    >>> str(trial.ending.end), trial.ending.ticks
    ('duration', 1800)
    """

    def __init__(
        self,
        instance: Instance,
        *,
        sinks: Sequence[Sink] = (),
        record: Path | str | None = None,
        simulator: Simulator | None = None,
        link: Link | None = None,
        watchers: Sequence[Watcher] = (),
    ) -> None:
        agents = _agents(instance, link)
        writer = () if record is None else (RecordWriter(record),)
        super().__init__(
            instance,
            simulator=simulator or simulators.load(instance.simulator),
            agents=agents,
            sinks=(*writer, *sinks),
            watchers=watchers if link is None else (link, *watchers),
            linked=link is not None,
        )

    def fork(self, seed: int | None = None, *, record: Path | str | None = None, overwrite: bool = False) -> Self:
        """Return an independent copy of this trial at its present frame.

        Given the same commands both go on equally to the bit, whichever is stepped first. The fork has no controller:
        call `step`, or `run` with a controller.

        Parameters
        ----------
        seed : int, optional
            Seed of all random numbers drawn from here on, including the noise of the present observation; what
            e-agents have chosen before stays. By default that of the instance. A fork with another seed has an event
            that says so, and its instance has that seed.
        record : Path or str, optional
            File of the fork's record, which begins with the first frame of this trial; this trial must have a
            record, and the seed must be the same. By default a fork has none.
        overwrite : bool
            Whether an existing record may be replaced.

        Returns
        -------
        Trial
            Its `sinks` are copies of those of this trial that can be copied (`protocols.Forks`): a `Scorer` can,
            sinks that write files can't.

        Raises
        ------
        DubinsTrafficError
            If the trial has ended.
        InputError
            If a part of the trial can't be copied, such as a simulator or an e-agent in another process; or if the
            record is impossible.

        Examples
        --------
        >>> import dubins_traffic as dt
        >>> trial = dt.Trial(dt.draw(dt.load_config("demo"), seed=1, trial=0))
        >>> fork = trial.fork()
        >>> trial.step((0.5, 0.0)) == fork.step((0.5, 0.0))
        True
        """
        if seed is not None:
            check_numbers(seed, self.instance.trial)
        writer = None if record is None else self._writer(seed)
        twin = super().fork(seed)
        if writer is not None and record is not None:
            twin._buffer.add(writer.fork(record, overwrite=overwrite))
        return twin

    def run(self, controller: str | Controller, deadline: float | None = None) -> Ending:
        """Start a controller in the present frame and let it drive to the end of the trial.

        The parameters are those of `run_trial`. A fault of the controller ends the trial and is not raised.
        """
        driver = controllers.load(controller) if isinstance(controller, str) else controller
        ending, _ = run(self, driver, deadline)
        return ending

    def _writer(self, seed: int | None) -> RecordWriter:
        """Return the writer of this trial's record; InputError if there is none, or a fork's seed differs."""
        writers = [sink for sink in self.sinks if isinstance(sink, RecordWriter)]
        if not writers:
            raise InputError("this trial has no record to continue", field="record", expected="a trial with a record")
        if seed not in (None, self.instance.seed):
            raise InputError(
                "a fork with another seed can't have a record",
                field="seed",
                value=seed,
                expected="no seed with `record`",
            )
        return writers[0]


def _agents(instance: Instance, link: Link | None) -> Sequence[Driver]:
    remote = [agent for agent in instance.e_agents if agent.kind == REMOTE]
    if remote and link is None:
        raise InputError(
            f"{remote[0].name} is driven by a program elsewhere, and this run has no transport to one",
            field="e-agents",
            value=remote[0].type,
            expected="a built-in type, or a run over a transport, such as dubins-traffic ros1 run",
        )
    local: list[Driver] = [fleet_of(instance)] if len(remote) < len(instance.e_agents) else []
    return local if link is None or not remote else [*local, link.agents()]


@dataclass(frozen=True, slots=True)
class Result(Tabulated):
    """The result of a trial: instance, ending, score, wall-clock figures, and the path of its record.

    `paths` is a sketch of the paths of the cars, for pictures.
    """

    instance: Instance
    controller: str
    ending: Ending
    score: Score
    wall: wall.Wall
    record: Path | None
    paths: Paths | None = field(default=None, compare=False)

    def __repr__(self) -> str:
        record = f", record {self.record}" if self.record else ""
        return f"<Result: {self.instance.title}, {self.score.summary}{record}>"

    def _repr_html_(self) -> str:
        paths = self.paths or Paths()
        return trial_html(self.instance, self.score, paths.lines(), paths.last)

    def asdict(self) -> dict[str, Any]:
        """Return the score as one element of ``trials`` in ``run --json``."""
        return self.score.asdict()


def run_trial(
    instance: Instance,
    controller: str | Controller = "lanes",
    *,
    record: Path | str | None = None,
    overwrite: bool = False,
    deadline: float | None = None,
    sinks: Sequence[Sink] = (),
    link: Link | None = None,
    simulator: Simulator | None = None,
    sketch: bool = True,
    name: str | None = None,
    metrics: Sequence[MetricSpec] = (),
    watchers: Sequence[Watcher] = (),
) -> Result:
    """Run one controller on one instance, and score it.

    Parameters
    ----------
    instance : Instance
        What is run.
    controller : str or Controller
        A built-in name, ``module:Class``, ``path/to/file.py:Class``, or a controller.
    record : Path or str, optional
        Where to write the record (`*.mcap`); its wall-clock sidecar is written beside it.
    overwrite : bool
        Whether an existing record may be replaced.
    deadline : float, optional
        Seconds within which each `act` must answer; by default it may take its time.
    sinks : sequence of Sink
        Further sinks.
    link : Link, optional
        Connects to the drivers of remote cars. If the ego is one, of `controller` only an ending ``+shield`` matters:
        then that ego drives under the shield.
    simulator : Simulator, optional
        Replaces the simulator that the instance names; closed when the trial is over.
    sketch : bool
        Whether the result has a sketch of the paths of the cars, for pictures: some kilobytes for each car.
    name : str, optional
        Name of the controller in record and score; by default the name by which it was given, or that of its class.
    metrics : sequence of str or callable
        Further metrics: names, ``module:Class``, ``path/to/file.py:Class``, or classes (docs/extending/metric.md).
    watchers : sequence of Watcher
        Are shown every frame at once.

    Raises
    ------
    InputError
        If the controller or a metric can't be loaded, or the record can't be written.
    """
    metrics = scores.with_share(metrics, [controller])
    called, driver = _driver(controller, link)
    name = called if name is None else name
    scorer, paths = Scorer(metrics), Paths()
    writer = None
    if record is not None:
        writer = RecordWriter(record, controller=name, overwrite=overwrite)
    first = () if writer is None else (writer,)
    drawn = (paths,) if sketch else ()
    try:
        with (
            put_back(),
            Trial(
                instance,
                sinks=(*first, *drawn, scorer, *sinks),
                link=link,
                simulator=simulator,
                watchers=watchers,
            ) as trial,
        ):
            try:
                ending, measured = run(trial, driver, deadline)
            finally:
                if link is not None and trial.ending is not None:
                    link.finish(trial.ending)
        if link is not None:
            measured = link.completed(measured)
    finally:
        if writer is not None:
            writer.close()
    path = None if record is None else Path(record)
    if path is not None:
        wall.write(path, measured)
    score = scorer.result(controller=name, record=path, wall=measured)
    return Result(instance, name, ending, score, measured, path, paths if sketch else None)


def _driver(controller: str | Controller, link: Link | None) -> tuple[str, Controller]:
    """Return the name of the ego's controller, and the controller."""
    if link is not None and link.ego:
        name, driver = link.name, link.controller()
        if isinstance(controller, str) and controllers.is_shielded(controller):
            return controllers.shielded(name), controllers.under_shield(driver, controller)
        return name, driver
    name = controller if isinstance(controller, str) else type(controller).__name__
    driver = controllers.load(controller) if isinstance(controller, str) else controller
    return name, driver if link is None else link.beside(driver)
