"""Plans of runs: the jobs that run the trials of a configuration, an instance or a record.

All jobs of a plan are known beforehand, and each can run in any process and in any order. A session over a transport
has a plan of another kind (`sessions.plan`), though the user names its trials in the same way: its trials are drawn one
after another, endlessly if asked, and share one connection to the drivers. What both need stands here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path

from dubins_traffic.cars.dynamics import require_dubins
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.files import exists, is_stream, require_output
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.files import DOCUMENTS
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.trial_data import TrialData
from dubins_traffic.record.reader import Record
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.jobs import Job
from dubins_traffic.runs.record_folder import check_choice, check_folder, claim, name
from dubins_traffic.runs.single import Result
from dubins_traffic.runs.sources import load
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.score import ScoreSheet
from dubins_traffic.simulators import registry as simulators

DEFAULT_CONTROLLER = "lanes"
MOST_RUNS = 1_000_000
DUBINS_ONLY = ("rules", "synthesized")
"""Built-in controllers that support the Dubins car only; the shield does, too."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The jobs to run, in order, and what is needed to conclude them.

    `configuration` is the one from which trials are drawn, if any; `data` the trial data file to write; `before` the
    number of runs that are left out since their records exist; `began` the time at which the plan was made.
    """

    jobs: tuple[Job, ...]
    configuration: Configuration | None
    data: Path | None = None
    before: int = 0
    began: datetime = field(default_factory=lambda: datetime.now(UTC))

    def conclude(self, results: Iterable[Result]) -> ScoreSheet:
        """Return the scores of finished trials in their order, and write the trial data file if one was asked for.

        Raises
        ------
        InputError
            If the file can't be written.
        """
        done = sorted(results, key=lambda result: (result.instance.trial, str(result.record)))
        return concluded(done, self.configuration, self.data, self.began)


def concluded(
    results: Sequence[Result], configuration: Configuration | None, data: Path | None, began: datetime
) -> ScoreSheet:
    """Return the scores of finished trials, and write the trial data file `data` of a configuration, if it is given."""
    if results and data is not None and configuration is not None:
        made = TrialData.build(configuration, [result.instance for result in results], began)
        made.write(data, overwrite=True)
    return ScoreSheet(tuple(result.score for result in results))


def plan(
    source: str | os.PathLike[str],
    controller: str | None = None,
    *,
    trials: int | None = None,
    repeat: int = 1,
    seed: int | None = None,
    rnd: str | os.PathLike[str] | None = None,
    data: str | os.PathLike[str] | None = None,
    overwrite_data: bool = False,
    records: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
    append: bool = False,
    deadline: float | None = None,
    simulator: str | None = None,
    show: bool = False,
    shield: bool = False,
    sandbox: str | None = None,
    metrics: Sequence[str] = (),
) -> Plan:
    """Return the plan of a run, with everything checked that can be checked before a trial runs.

    Parameters
    ----------
    source : path or str
        A trials configuration (file or shipped name), an instance or a record, told by content.
    controller : str, optional
        A built-in name, ``module:Class`` or ``path/to/file.py:Class``; by default `lanes`, and for a record its own.
    trials : int, optional
        Number of trials of a configuration, from number 0 on; by default as many as it says.
    repeat : int
        Number of times that each trial is run.
    seed : int, optional
        Seed of a configuration's trials, or of an instance document without one; 0 by default.
    rnd : path, optional
        A road network description that replaces the configuration's.
    data : path, optional
        File for the trial data of a configuration; refused if it exists unless `overwrite_data`.
    records : path, optional
        Folder for the records, made if missing: ``trial-0000.mcap`` for trial 0; with `repeat`,
        ``trial-0000-0000.mcap`` for its first run. A folder that holds records is refused, unless one of the following.
    overwrite : bool
        Whether to remove the records that the folder holds first.
    append : bool
        Whether to keep the records that the folder holds and run only the other trials; they must be of the same
        controller and instances.
    deadline : float, optional
        Wall-clock seconds within which each `act` must answer.
    simulator : str, optional
        Name of the simulator; by default that in the source.
    show : bool
        Whether the simulator shows the trials in a window of its own, at the pace of the clock.
    shield : bool
        Whether the controller drives under the shield (`controllers.shield`).
    sandbox : str, optional
        Limits of the box in which the controller drives (`controllers.registry.sandboxed`); by default it drives in
        this process.
    metrics : sequence of str
        Further metrics: names, ``module:Class`` or ``path/to/file.py:Class``.

    Raises
    ------
    InputError
        If an argument or the source is wrong; nothing has been written then.
    """
    runnable = load_runnable(source, rnd=rnd, seed=seed or 0)
    recorded = runnable.controller if isinstance(runnable, Record) else None
    named = (recorded or DEFAULT_CONTROLLER) if controller is None else controller
    controller = controllers.dressed(named, shield=shield, sandbox=sandbox)
    controllers.load(controller)
    scores.columns(further := scores.with_share(metrics, [controller]))
    _check_deadline(deadline)
    check_choice(records, data, overwrite=overwrite, append=append)
    configuration = None
    if isinstance(runnable, Configuration):
        configuration = runnable if simulator is None else runnable.with_simulator(simulator)
        count = runnable.number_trials if trials is None else trials
        _check_count(count, repeat)
        jobs = _drawn(configuration, controller, count, seed or 0)
    else:
        _check_count(1, repeat)
        given = runnable.instance if isinstance(runnable, Record) else runnable
        other_seed = None if seed == given.seed else seed
        _refuse(os.fspath(source), {"--trials": trials, "--seed": other_seed, "-f": data})
        instance = replace(given, simulator=simulator or given.simulator)
        jobs = [Job(instance.trial, instance.seed, controller, instance=instance)]
    if (first := jobs[0].instance) is not None:
        _check_first(os.fspath(source), first, controller, named=simulator is not None, show=show)
    target = None if data is None else check_data_file(Path(data), overwrite_data, source, configuration)
    jobs = [replace(job, deadline=deadline, show=show, metrics=further) for job in jobs]
    if records is None:
        return Plan(tuple(job for job in jobs for _ in range(repeat)), configuration, target)
    folder = check_folder(records)
    kept = claim(folder, controller, _instances(jobs, seed or 0), overwrite=overwrite, append=append)
    remaining = [job for job in _recorded(jobs, folder, repeat) if job.record and job.record.name not in kept]
    return Plan(tuple(remaining), configuration, target, len(jobs) * repeat - len(remaining))


def load_runnable(
    source: str | os.PathLike[str], *, rnd: str | os.PathLike[str] | None, seed: int
) -> Configuration | Instance | Record:
    """Return what `sources.load` returns, unless it is a road network, of which no trials can be run."""
    loaded = load(source, rnd=rnd, seed=seed)
    if isinstance(loaded, RoadNetwork):
        expected = "a trials configuration, a problem instance or a record"
        raise InputError("a road network can't be run", file=os.fspath(source), expected=expected)
    return loaded


def _instances(jobs: Sequence[Job], seed: int) -> Callable[[int], Instance]:
    """Return a function that returns the instance of a trial, by its number, from the source of `jobs`."""

    def make(trial: int) -> Instance:
        first = jobs[0]
        if first.configuration is not None:
            return draw(first.configuration, seed, trial)
        if first.instance is None or trial != first.trial:
            raise InputError("no such trial", field="trial", value=trial, expected=str(first.trial))
        return first.instance

    return make


def _drawn(configuration: Configuration, controller: str, trials: int, seed: int) -> list[Job]:
    """Return a job per trial; the first instance is drawn here, to refuse early a configuration that can't be drawn."""
    jobs = [Job(trial, seed, controller, configuration=configuration) for trial in range(trials)]
    if jobs:
        jobs[0] = replace(jobs[0], instance=draw(configuration, seed, 0))
    return jobs


def _recorded(jobs: Sequence[Job], folder: Path, repeat: int) -> list[Job]:
    """Return each job `repeat` times, each with its record in `folder`."""
    planned: list[Job] = []
    for job in jobs:
        for run in range(repeat):
            record = folder / name(job.trial, run if repeat > 1 else None)
            planned.append(replace(job, record=record, overwrite=record.exists()))
    return planned


def _refuse(source: str, options: dict[str, object]) -> None:
    for option, value in options.items():
        if value is not None:
            raise InputError(
                "is for configurations; this is one trial",
                file=source,
                field=option,
                value=value,
                expected="a trials configuration, or none of it",
            )


def _check_first(source: str, first: Instance, controller: str, *, named: bool, show: bool) -> None:
    """Refuse a simulator or car model with which the first trial can't be run.

    `named` tells whether the simulator is named by an option or by the source. A car model that the controller or the
    shield does not support would end every trial as a fault.
    """
    check_simulator("--simulator" if named else source, first.simulator, show=show)
    if controller not in DUBINS_ONLY and not controllers.is_shielded(controller):
        return
    try:
        require_dubins(first.problem.car, f"{controller!r} is known to be right")
    except InputError as error:
        raise error.within(file=source) from None


def check_simulator(source: str, name: str, *, show: bool = False) -> None:
    """Raise InputError, naming `source`, if there is no simulator called `name` or it can't be used here."""
    try:
        simulators.load(name, show=show).close()
    except InputError as error:
        raise error.within(file=source) from None


def _check_count(trials: int, repeat: int) -> None:
    if trials < 1 or repeat < 1 or trials * repeat > MOST_RUNS:
        expected = f"both at least 1, and at most {MOST_RUNS} runs in all"
        raise InputError("not a number of runs", file="--trials, --repeat", value=(trials, repeat), expected=expected)


def _check_deadline(deadline: float | None) -> None:
    if deadline is not None and not 0 < deadline < float("inf"):
        raise InputError("not a time", file="--deadline", value=deadline, expected="seconds, a number > 0")


def check_data_file(
    path: Path, overwrite: bool, source: str | os.PathLike[str], configuration: Configuration | None
) -> Path:
    """Return `path` if trial data can be written there; InputError, as of `files.require_output`, if not.

    `overwrite` is whether a file that exists may be replaced. The `source` of the trials, and the road network that its
    `configuration` names, never are.
    """
    if exists(path) and not is_stream(path) and not overwrite:
        expected = "a new file; --overwrite-trial-data (-F) overwrites"
        raise InputError("exists", file=str(path), expected=expected)
    read = source, None if configuration is None else configuration.network_file
    require_output(path, "trial data", DOCUMENTS, overwrite=True, apart_from=read)
    return path
