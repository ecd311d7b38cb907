"""A competition: what its file says, its phases, and which trials each of them consists of."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, time, timedelta
from pathlib import Path
from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from dubins_traffic.campaign.campaign import check_names, configuration_of
from dubins_traffic.campaign.settings import Entry, Some
from dubins_traffic.competition.sealing import secret_seeds
from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.faults import Strict, fault, parse
from dubins_traffic.problem.files import plain, read_toml
from dubins_traffic.problem.instance import Instance
from dubins_traffic.sandbox.limits import KIB, MIB, Limits
from dubins_traffic.scoring.icra2016 import weight_of

PHASE = r"^[a-z][a-z0-9-]{0,39}$"
MOST_TRIALS = 100_000
"""Most trials of a phase, all configurations together."""
SECRET = "secret"
"""In place of a seed: the seeds are drawn by `dubins-traffic competition seal`, and nobody knows them."""
RUN_TWICE = 20
"""A service runs one trial of a submission in so many a second time, and one at least."""
WALL_S = (30.0, 120.0)
"""Least and most of twice the duration of a trial, which is its limit of wall-clock time unless a phase sets one."""
UTC_TIME = "a time in UTC, as 2027-03-01T12:00:00Z"


def run_twice(trials: int) -> int:
    """Return how many trials of a submission a service runs a second time, to see whether they come out the same."""
    return max(1, trials // RUN_TWICE)


def _time(value: object) -> datetime:
    """Read a time; one that does not say that it is in UTC is refused, since two people would read two times."""
    try:
        time = datetime.fromisoformat(value) if isinstance(value, str) else value
    except ValueError:
        time = None
    if not isinstance(time, datetime) or time.utcoffset() != timedelta(0):
        raise fault("not a time in UTC", UTC_TIME)
    return time.astimezone(UTC)


def _seed(value: object) -> object:
    if value == SECRET or (isinstance(value, int) and not isinstance(value, bool) and 0 <= value < limits.SEEDS):
        return value
    raise fault("not a seed", f'an integer >= 0 and < {limits.SEEDS}, or "{SECRET}"')


Time = Annotated[datetime, BeforeValidator(_time), WithJsonSchema({"type": "string", "format": "date-time"})]
Seed = Annotated[
    Any,
    AfterValidator(_seed),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 0, "maximum": limits.SEEDS - 1}, {"const": SECRET}]}),
]
Seconds = Annotated[float, Field(gt=0, le=limits.SECONDS)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class LimitsTable(Strict):
    """What a submission may use in one trial. Times of the processor are those of all its processes together."""

    start: Seconds = Field(default=60.0, description="processor time until the first command, s")
    decision: Seconds = Field(default=0.1, description="processor time of a decision that costs nothing, s")
    bank: Annotated[float, Field(ge=0, le=limits.SECONDS)] = Field(
        default=10.0, description="processor time a trial for decisions that take longer, s"
    )
    wall: Seconds | None = Field(
        default=None,
        description="wall-clock time beyond five times its processor time, s: for those that sleep; left out: twice "
        f"the duration of the trial, {WALL_S[0]:g} at least and {WALL_S[1]:g} at most",
    )
    memory: Annotated[int, Field(ge=16, le=1_000_000)] = Field(default=1024, description="memory, MiB")
    processes: Annotated[int, Field(ge=1, le=10_000)] = Field(default=64, description="processes and threads at a time")
    files: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=64, description="what all files that it writes may hold together, MiB"
    )
    output: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=256, description="what it may print in a trial, KiB; the last 8 KiB are kept"
    )

    def of(self, duration: float) -> Limits:
        """Return what a box takes, seconds and bytes, for a trial that lasts so many seconds."""
        wall = min(max(2.0 * duration, WALL_S[0]), WALL_S[1]) if self.wall is None else self.wall
        return Limits(
            self.start, self.decision, self.bank, wall, memory=self.memory * MIB, processes=self.processes,
            files=self.files * MIB, output=self.output * KIB,
        )  # fmt: skip


class Quota(Strict):
    """How often a team may submit; what ends by a fault of the platform never counts."""

    a_day: Count | None = Field(default=None, description="submissions in a day, from 0:00 UTC")
    total: Count | None = Field(default=None, description="submissions in the phase")
    queued: Count | None = Field(default=None, description="submissions that wait or run at a time")


QUOTA = Quota(a_day=100, queued=20)
"""Of a phase that sets none."""


class PhaseModel(Strict):
    """One phase of a competition."""

    seed: Seed = Field(
        description=f'root seed that everybody may know, or "{SECRET}": seeds that `seal` draws and encrypts'
    )
    trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(description="trials of each configuration")
    configurations: Annotated[list[Annotated[str, Field(min_length=1)]], Some] | None = Field(
        default=None, description="names of the configurations; left out: all of the competition"
    )
    opens: Time | None = Field(
        default=None, description="UTC; what is received from this second on counts; left out: always open"
    )
    closes: Time | None = Field(
        default=None, description="UTC; what is received before this second counts; left out: never"
    )
    shows: Literal["all", "aggregates", "nothing"] = Field(
        description="what participants see until it closes: all; rounded aggregates and a tail of the log; "
        "nothing but whether it is received, queued or finished, and faults of the platform"
    )
    least_trials: Annotated[int, Field(ge=1, le=MOST_TRIALS)] = Field(
        default=10, description="aggregates over fewer trials than these are not shown"
    )
    digits: Annotated[int, Field(ge=0, le=6)] = Field(
        default=2, description="digits after the point to which aggregates are rounded"
    )
    log_lines: Annotated[int, Field(ge=0, le=10_000)] = Field(
        default=20, description="lines of the log's tail that are shown with aggregates"
    )
    limits: LimitsTable = Field(default=LimitsTable(), description="what a submission may use in one trial")
    quota: Quota = Field(
        default=QUOTA,
        description=f"how often a team may submit; left out: {QUOTA.a_day} a day, {QUOTA.queued} that wait or run",
    )

    @model_validator(mode="after")
    def _consistent(self) -> PhaseModel:
        if self.opens is not None and self.closes is not None and self.closes <= self.opens:
            raise fault("closes before it opens", "a time after opens", "closes", self.closes.isoformat())
        if self.seed == SECRET and self.closes is None:
            raise fault("secret seeds and no end", "closes: when the seeds may be revealed", "closes", None)
        if self.seed == SECRET and self.shows == "all":
            raise fault("secret seeds that everybody sees", "aggregates or nothing", "shows", self.shows)
        return self


class Ranking(Strict):
    """What ranks the entries of a phase."""

    metric: Literal["counted_rounds", "icra2016"] = Field(
        default="counted_rounds",
        description="the mean of this over the trials: rounds of trials that are clean and ran their whole "
        "duration, else 0; or the score of ICRA 2016, where a trial that did not run its whole duration counts as "
        "a collision",
    )
    ties: Literal["satisfied", "none"] = Field(
        default="satisfied",
        description="what parts entries of equal means: the share of trials that are `satisfied`; or nothing does",
    )


class CompetitionModel(Strict):
    """A competition: its configurations, its phases, what ranks."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    title: str = Field(min_length=1, max_length=200, description="what it is called")
    about: str = Field(default="", max_length=100_000, description="a text for participants, Markdown")
    pages: dict[Annotated[str, Field(pattern=PHASE)], Annotated[str, Field(max_length=100_000)]] = Field(
        default={}, description="further texts by name, Markdown, each a page of the web"
    )
    configurations: Annotated[list[Entry], Some] = Field(
        description="files, names of shipped configurations, or {name, file} or {name, document}"
    )
    ranking: Ranking = Field(default=Ranking(), description="what ranks")
    phases: Annotated[dict[Annotated[str, Field(pattern=PHASE)], PhaseModel], Field(min_length=1)] = Field(
        description="the phases by name, such as practice, validation, test"
    )


@dataclass(frozen=True, slots=True)
class Named:
    """A configuration and what the competition calls it."""

    name: str
    configuration: Configuration


@dataclass(frozen=True, slots=True)
class Phase:
    """A phase: `trials` of each of its configurations, one configuration after the other.

    Trial number n is trial ``n % trials`` of configuration ``n // trials``, drawn from a seed of its own where
    the seeds are secret, else from the one seed of the phase.
    """

    name: str
    """Such as ``test``."""
    model: PhaseModel
    """What the file says of it."""
    configurations: tuple[Named, ...]
    """Those of its trials."""
    ranking: Ranking
    """What ranks its entries."""
    folder: Path | None = None
    """Where sealed and revealed seeds lie; None for a competition that is no file."""

    @property
    def opens(self) -> datetime | None:
        """What is received from this time on counts; None: always."""
        return self.model.opens

    @property
    def closes(self) -> datetime | None:
        """What is received before this time counts; None: for ever."""
        return self.model.closes

    @property
    def quota(self) -> Quota:
        """How often a team may submit."""
        return self.model.quota

    @property
    def shows(self) -> Literal["all", "aggregates", "nothing"]:
        """What participants see until it closes."""
        return self.model.shows

    @property
    def secret(self) -> bool:
        """Whether its seeds are secret until it has closed."""
        return self.model.seed == SECRET

    @property
    def numbers(self) -> range:
        """The numbers of its trials."""
        return range(self.model.trials * len(self.configurations))

    @property
    def rules(self) -> str:
        """SHA-256 of all that decides a trial and its rank, but for the seeds: it is committed to with them."""
        return digest(
            {
                "configurations": [
                    {"name": named.name, "document": named.configuration.inlined()} for named in self.configurations
                ],
                "trials": self.model.trials,
                "limits": self.model.limits.model_dump(),
                "ranking": self.ranking.model_dump(),
            }
        )

    def is_open(self, now: datetime | None = None) -> bool:
        """Tell whether what is received now counts."""
        now = now or datetime.now(UTC)
        return (self.opens is None or self.opens <= now) and not self.is_closed(now)

    def is_closed(self, now: datetime | None = None) -> bool:
        """Tell whether the phase is over."""
        return self.closes is not None and (now or datetime.now(UTC)) >= self.closes

    def seeds(self, key: bytes | None = None) -> tuple[int, ...]:
        """Return the seed of each trial, by number.

        Parameters
        ----------
        key : bytes, optional
            Passphrase or contents of the key file, for seeds that are still secret.

        Raises
        ------
        InputError
            If the seeds are secret, not revealed, and the key is missing or wrong.
        """
        if not self.secret:
            return (cast("int", self.model.seed),) * len(self.numbers)
        return secret_seeds(self, key)

    def place(self, number: int) -> tuple[Named, int]:
        """Return the configuration of a trial, and its number in it; InputError if there is no such trial."""
        if number not in self.numbers:
            raise InputError(
                "no such trial",
                field=f"phases.{self.name}",
                value=number,
                expected=f"a number below {len(self.numbers)}",
            )
        return self.configurations[number // self.model.trials], number % self.model.trials

    def check_draws(self) -> None:
        """Draw the first trial of each configuration; InputError if one can't be drawn."""
        for number in self.numbers[:: self.model.trials]:
            try:
                self.instance(number, 0 if self.secret else self.seeds()[number])
            except InputError as error:
                named, _ = self.place(number)
                raise error.within(field=f"phases.{self.name}: {named.name}") from None

    def instance(self, number: int, seed: int) -> Instance:
        """Return what trial `number` is drawn to be from its seed."""
        named, trial = self.place(number)
        return draw(named.configuration, seed, trial)

    def limits(self, instance: Instance) -> Limits:
        """Return what a submission may use in a trial."""
        return self.model.limits.of(instance.duration)


@dataclass(frozen=True, slots=True)
class Competition:
    """A checked competition."""

    document: Mapping[str, Any]
    """What the file says, with the configurations and their road networks written in; JSON."""
    model: CompetitionModel
    """The same, checked, with defaults."""
    configurations: tuple[Named, ...]
    """All of them."""
    file: str | None = field(default=None, compare=False)
    """Where it was read; named in messages."""
    folder: Path | None = field(default=None, compare=False)
    """Where sealed and revealed seeds lie: the folder of the file."""

    @staticmethod
    def from_document(document: Mapping[str, Any], file: str | None = None, folder: Path | None = None) -> Competition:
        """Check `document`; relative paths are looked up in `folder`, then in the current directory.

        Raises
        ------
        InputError
            For the first thing wrong, with its field.
        """
        plain_document = plain(_dated(document), file)
        model = parse(CompetitionModel, plain_document, file=file)
        try:
            check_names([entry.name for entry in model.configurations], "configurations")
            configurations = tuple(
                Named(entry.name, configuration_of(entry, k, folder)) for k, entry in enumerate(model.configurations)
            )
            made = Competition(_complete(plain_document, configurations), model, configurations, file, folder)
            for name in model.phases:
                _check_phase(made.phase(name))
        except InputError as error:
            raise error.within(file=file) from None
        return made

    @property
    def title(self) -> str:
        """What it is called."""
        return self.model.title

    @property
    def ranking(self) -> Ranking:
        """What ranks."""
        return self.model.ranking

    @property
    def phases(self) -> tuple[Phase, ...]:
        """All phases, in the order of the file."""
        return tuple(self.phase(name) for name in self.model.phases)

    @property
    def digest(self) -> str:
        """SHA-256 of the document."""
        return digest(self.document)

    def phase(self, name: str) -> Phase:
        """Return the phase called `name`.

        InputError if there is none, or it names a configuration that there is not.
        """
        model = self.model.phases.get(name)
        if model is None:
            expected = f"one of {', '.join(self.model.phases)}"
            raise InputError("no such phase", file=self.file, field="phases", value=name, expected=expected)
        known = {named.name: named for named in self.configurations}
        for k, wanted in enumerate(model.configurations or ()):
            if wanted not in known:
                raise InputError(
                    "no such configuration",
                    field=f"phases.{name}.configurations[{k}]",
                    value=wanted,
                    expected=f"one of {', '.join(known)}",
                )
        chosen = tuple(known[wanted] for wanted in model.configurations or known)
        return Phase(name, model, chosen, self.ranking, self.folder)


def load_competition(path: str | os.PathLike[str]) -> Competition:
    """Return the competition in the TOML file at `path`; of a folder, in its `competition.toml`.

    InputError if there is no such file or something in it is wrong.
    """
    place = Path(path) / FILE if Path(path).is_dir() else Path(path)
    document = read_toml(place, "a competition file, TOML")
    return Competition.from_document(document, str(place), place.parent)


FILE = "competition.toml"
"""What the file is called in the folder of a competition."""


def digest(document: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a JSON object whose keys are sorted, without blanks."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _dated(value: object) -> Any:
    """Return what TOML says with its times as texts."""
    if isinstance(value, Mapping):
        return {key: _dated(item) for key, item in cast("Mapping[object, object]", value).items()}
    if isinstance(value, list):
        return [_dated(item) for item in cast("list[object]", value)]
    return value.isoformat() if isinstance(value, date | time) else value


def _complete(document: dict[str, Any], configurations: tuple[Named, ...]) -> dict[str, Any]:
    entries = [{"name": named.name, "document": named.configuration.inlined()} for named in configurations]
    return {**document, "configurations": entries}


def _check_phase(phase: Phase) -> None:
    where = f"phases.{phase.name}"
    if len(phase.numbers) > MOST_TRIALS:
        raise InputError(
            "too many trials",
            field=f"{where}.trials",
            value=len(phase.numbers),
            expected=f"at most {MOST_TRIALS} in all",
        )
    check_names([named.name for named in phase.configurations], f"{where}.configurations")
    if phase.ranking.metric == "icra2016":
        for named in phase.configurations:
            if weight_of(draw(named.configuration)) is None:
                raise InputError(
                    "the score of ICRA 2016 is not defined here",
                    field="ranking.metric",
                    value=named.name,
                    expected="configurations on a grid, whose e-agents are called agent...",
                )
