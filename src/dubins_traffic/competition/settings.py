"""Models of the competition file: what it may say, and the defaults."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema, model_validator

from dubins_traffic.campaign.settings import Entry, Some
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, fault

PHASE = r"^[a-z][a-z0-9-]{0,39}$"
MOST_TRIALS = 100_000
"""Most trials of a phase, all configurations together."""
SECRET = "secret"
"""In place of a seed: the seeds are drawn by `dubins-traffic competition seal`, and nobody knows them."""
UTC_TIME = "a time in UTC, as 2027-03-01T12:00:00Z"


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
    if value == SECRET or (
        isinstance(value, int) and not isinstance(value, bool) and 0 <= value < limits.SEEDS
    ):
        return value
    raise fault("not a seed", f'an integer >= 0 and < {limits.SEEDS}, or "{SECRET}"')


Time = Annotated[datetime, BeforeValidator(_time), WithJsonSchema({"type": "string", "format": "date-time"})]
Seed = Annotated[
    Any,
    AfterValidator(_seed),
    WithJsonSchema(
        {"anyOf": [{"type": "integer", "minimum": 0, "maximum": limits.SEEDS - 1}, {"const": SECRET}]}
    ),
]
Seconds = Annotated[float, Field(gt=0, le=limits.SECONDS)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]


class Limits(Strict):
    """What a submission may use in one trial. Times of the processor are those of all its processes together."""

    start: Seconds = Field(default=60.0, description="processor time until the first command, s")
    decision: Seconds = Field(default=0.1, description="processor time of a decision that costs nothing, s")
    bank: Annotated[float, Field(ge=0, le=limits.SECONDS)] = Field(
        default=10.0, description="processor time a trial for decisions that take longer, s"
    )
    wall: Seconds = Field(
        default=600.0,
        description="wall-clock time beyond five times its processor time, s: for those that sleep",
    )
    memory: Annotated[int, Field(ge=16, le=1_000_000)] = Field(default=1024, description="memory, MiB")
    processes: Annotated[int, Field(ge=1, le=10_000)] = Field(
        default=64, description="processes and threads at a time"
    )
    files: Annotated[int, Field(ge=1, le=100_000)] = Field(
        default=64, description="what all files that it writes may hold together, MiB"
    )
    output: Annotated[int, Field(ge=1, le=1_000_000)] = Field(
        default=256, description="what it may print in a trial, KiB; the last 8 KiB are kept"
    )


class Quota(Strict):
    """How often a team may submit; what ends by a fault of the platform never counts."""

    a_day: Count | None = Field(default=None, description="submissions in a day, from 0:00 UTC")
    total: Count | None = Field(default=None, description="submissions in the phase")
    queued: Count | None = Field(default=None, description="submissions that wait or run at a time")


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
    limits: Limits = Field(default=Limits(), description="what a submission may use in one trial")
    quota: Quota = Field(default=Quota(), description="how often a team may submit")

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
    about: str = Field(default="", max_length=100_000, description="a text for participants")
    configurations: Annotated[list[Entry], Some] = Field(
        description="files, names of shipped configurations, or {name, file} or {name, document}"
    )
    ranking: Ranking = Field(default=Ranking(), description="what ranks")
    phases: Annotated[dict[Annotated[str, Field(pattern=PHASE)], PhaseModel], Field(min_length=1)] = Field(
        description="the phases by name, such as practice, validation, test"
    )
