"""Models of a suite's file: what it may say."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, model_validator

from dubins_traffic.campaign.settings import CampaignModel
from dubins_traffic.problem.faults import Strict, fault
from dubins_traffic.problem.parts import LatticePoint
from dubins_traffic.scoring.columns import SCORES

NAME = r"^[a-z0-9][a-z0-9-]*$"
Count = Annotated[int, Field(ge=0)]


class GameEntry(Strict):
    """A game of cells, with the answer that a solver must come to."""

    name: str = Field(pattern=NAME, max_length=80, description="what it is called in tables")
    rnd: dict[str, Any] = Field(description="its road network, a road network description")
    goals: Annotated[list[LatticePoint], Field(min_length=1)] = Field(
        description="lattice points [x, y] of intersections to visit again and again"
    )
    cars: Annotated[int, Field(ge=1)] = Field(description="e-agents")
    assume: str = Field(description="what is assumed of them, as `synth --assume` takes it; empty: nothing")
    order_degree: Annotated[int, Field(ge=1)] = Field(
        description="intersections of so many roads are crossings"
    )
    positions: Count = Field(description="positions of the game")
    winning: Count = Field(description="positions from which the ego wins")

    @model_validator(mode="after")
    def _possible(self) -> GameEntry:
        if self.winning > self.positions:
            raise fault("more won than there are", "at most positions", "winning", self.winning)
        return self


class CaseEntry(Strict):
    """A case: an instance in full detail, as `falsify` finds them."""

    name: str = Field(pattern=NAME, max_length=80, description="what it is called in tables")
    document: dict[str, Any] = Field(description="the instance, version 1, with starts, duration and seed")


class SuiteModel(Strict):
    """A suite: trials as a campaign has them, cases, or games. It never changes; what is another gets another name."""

    version: Annotated[int, Field(ge=0, le=0)] = Field(description="0")
    name: str = Field(pattern=NAME, max_length=40, description="its name, such as rules-2026")
    title: str = Field(min_length=1, max_length=200, description="what it is, in a line")
    metric: str = Field(default="counted_rounds", description="the column of the score that ranks results")
    campaign: CampaignModel | None = Field(
        default=None,
        description="its trials; the controllers are those of the page of results, and no part of the hash",
    )
    cases: Annotated[list[CaseEntry], Field(min_length=1)] | None = Field(
        default=None, description="its cases, a trial each"
    )
    games: Annotated[list[GameEntry], Field(min_length=1)] | None = Field(
        default=None, description="its games of cells"
    )

    @model_validator(mode="after")
    def _one_kind(self) -> SuiteModel:
        if [self.campaign, self.cases, self.games].count(None) != 2:
            raise fault("not one kind of suite", "one of campaign, cases and games")
        if self.metric not in SCORES:
            raise fault("unknown column of a score", "one of " + ", ".join(SCORES), "metric", self.metric)
        kind = "games" if self.games else "cases"
        names = [entry.name for entry in (*(self.games or ()), *(self.cases or ()))]
        for k, name in enumerate(names):
            if name in names[:k]:
                raise fault("name taken", "a name of its own", f"{kind}[{k}].name", name)
        if self.campaign is not None and self.campaign.trials is None:
            raise fault("trials left out", "trials of each combination", "campaign.trials")
        return self
