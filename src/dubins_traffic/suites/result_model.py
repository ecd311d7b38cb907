"""Models of a file of results: what came of a suite, and the seconds that it took in a file beside it."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from dubins_traffic.problem.faults import Strict, fault
from dubins_traffic.record.sink import BY_CONTROLLER
from dubins_traffic.suites.settings import Count

FORMAT = "dubins-traffic suite results"
WALL_FORMAT = "dubins-traffic suite seconds"
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Entry = Annotated[str, Field(min_length=1, max_length=200)]
Seconds = Annotated[float, Field(ge=0)]
Columns = dict[str, list[bool | int | float | str | None]]


class TrialsEntry(Strict):
    """What came of the trials of one controller."""

    controller: Entry = Field(description="its name in tables")
    file: Digest | None = Field(default=None, description="SHA-256 of its file, if it is one in Python")
    ran: Literal["in process", "boxed", "trusted"] | None = Field(
        default=None,
        description="where it ran: in process (trusted), in a box, or told to be trusted; null: not said",
    )
    columns: Columns = Field(
        description="columns of the campaign's table, one value a trial, cell after cell"
    )

    @model_validator(mode="after")
    def _of_one_length(self) -> TrialsEntry:
        if len({len(values) for values in self.columns.values()}) > 1:
            raise fault("columns of several lengths", "one value a trial in each", "columns")
        for clean, end in zip(self.columns.get("clean", ()), self.columns.get("end", ()), strict=False):
            if clean and end in BY_CONTROLLER:
                expected = "false where the controller ended the trial: run the suite again"
                raise fault("a clean trial that its controller ended", expected, "columns.clean", end)
        return self


class GameResult(Strict):
    """What a solver says of a game."""

    positions: Count | None = Field(default=None, description="positions, if the solver says how many")
    winning: Count | None = Field(default=None, description="positions from which the ego wins")
    realizable: bool | None = Field(default=None, description="whether the ego wins from all of them")
    fault: str | None = Field(default=None, max_length=500, description="why there is no answer")


class GamesEntry(Strict):
    """What one solver says of all games."""

    solver: Entry = Field(description="its name in tables")
    games: dict[str, GameResult] = Field(description="the answers, by the names of the games")


class ResultModel(Strict):
    """Results of a suite."""

    format: Literal["dubins-traffic suite results"] = Field(description=f'"{FORMAT}"')
    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    suite: str = Field(description="name of the suite")
    hash: Digest = Field(description="its hash, of all that decides problems and scores")
    trials: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="trials of each combination; null for games"
    )
    package: str = Field(description="version of dubins-traffic")
    code: Digest = Field(description="SHA-256 over its sources")
    entries: list[TrialsEntry] = Field(default=[], description="a controller each")
    solvers: list[GamesEntry] = Field(default=[], description="a solver each")


class WallModel(Strict):
    """Seconds on a wall clock, which do not repeat."""

    format: Literal["dubins-traffic suite seconds"] = Field(description=f'"{WALL_FORMAT}"')
    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    hash: Digest = Field(description="hash of the suite")
    entries: dict[str, dict[str, list[Any]]] = Field(
        default={}, description="of each controller, columns of seconds, one value a trial"
    )
    solvers: dict[str, dict[str, Seconds]] = Field(
        default={}, description="of each solver, seconds for each game"
    )
