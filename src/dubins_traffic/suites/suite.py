"""A suite: its document, its hash, and the campaign that runs it with given controllers."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, model_validator

from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.campaign.columns import SCORES
from dubins_traffic.campaign.settings import CampaignModel
from dubins_traffic.errors import InputError
from dubins_traffic.files import is_file, read_text
from dubins_traffic.problem.faults import Strict, fault, parse
from dubins_traffic.problem.files import parse_json, plain
from dubins_traffic.problem.parts import LatticePoint

NAME = r"^[a-z0-9][a-z0-9-]*$"
SHORT = 12
"""Digits of a hash in the names of files."""
_TOLD = ("title", "version")
"""Fields that may change without a change of the problems or their scores; the hash leaves them out."""

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
    order_degree: Annotated[int, Field(ge=1)] = Field(description="intersections of so many roads are crossings")
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


@dataclass(frozen=True)
class Suite:
    """A checked suite."""

    document: Mapping[str, Any]
    """What its file says."""
    model: SuiteModel
    """The same, checked, with defaults."""
    file: str | None = field(default=None, compare=False)
    """The file from which it was read; None for a shipped suite."""

    @staticmethod
    def from_document(document: Mapping[str, Any], file: str | None = None) -> Suite:
        """Check a document; InputError for the first thing wrong, with its field."""
        plain_document = plain(document, file)
        suite = Suite(plain_document, parse(SuiteModel, plain_document, file=file), file)
        if suite.model.campaign is not None:
            for k, entry in enumerate(suite.model.campaign.configurations):
                if entry.document is None:
                    raise InputError(
                        "a configuration elsewhere, which may change",
                        file=file,
                        field=f"campaign.configurations[{k}].file",
                        value=entry.file,
                        expected="{name, document}",
                    )
        return suite

    @property
    def name(self) -> str:
        """Its name."""
        return self.model.name

    @property
    def hash(self) -> str:
        """SHA-256 of all that determines problems and scores: without its title and the page's controllers."""
        decides = {name: value for name, value in self.document.items() if name not in _TOLD}
        if "campaign" in decides:
            decides["campaign"] = {name: value for name, value in decides["campaign"].items() if name != "controllers"}
        return hashlib.sha256(json.dumps(decides, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

    @property
    def label(self) -> str:
        """Name and hash in short: ``rules-2026-0123456789ab``, the name of its results."""
        return f"{self.name}-{self.hash[:SHORT]}"

    @property
    def trials(self) -> int | None:
        """Trials of each combination for each controller; None for games."""
        return None if self.model.campaign is None else self.model.campaign.trials

    @property
    def controllers(self) -> tuple[str, ...]:
        """The controllers of its page of results."""
        return () if self.model.campaign is None else tuple(self.model.campaign.controllers)

    def campaign(
        self, controllers: Sequence[str], trials: int | None = None, *, places: tuple[str, ...] | None = None
    ) -> Campaign:
        """Return the suite as a campaign.

        Parameters
        ----------
        trials : int, optional
            Number of trials of each combination, if only the first ones are to be run.
        places : tuple of str, optional
            The full names of the controllers, if they are not to be loaded.

        Raises
        ------
        InputError
            If the suite is one of games, a controller can't be loaded, or it has not so many trials.
        """
        template = self.document.get("campaign")
        if template is None or self.trials is None:
            raise InputError("a suite of another kind, which is no campaign", file=self.file or self.name)
        if trials is not None and not 1 <= trials <= self.trials:
            raise InputError(
                "not a number of its trials", file="--trials", value=trials, expected=f"1 to {self.trials}"
            )
        document = {
            **template,
            "name": self.label,
            "trials": trials or self.trials,
            "controllers": list(controllers),
        }
        return Campaign.from_document(document, self.file or self.name, places=places)


def shipped_suites() -> list[str]:
    """Return the names of the suites that are shipped."""
    items = (item.name for item in (files("dubins_traffic.suites") / "data").iterdir())
    return sorted(name.removesuffix(".json") for name in items if name.endswith(".json"))


def load_suite(name: str | os.PathLike[str]) -> Suite:
    """Return the suite of a shipped name, or in a file; InputError if there is none, or something in it is wrong."""
    text = os.fspath(name)
    known = shipped_suites()
    if text in known:
        shipped = files("dubins_traffic.suites") / "data" / f"{text}.json"
        return Suite.from_document(parse_json(shipped.read_text(encoding="utf-8"), text))
    if not is_file(text):
        expected = f"one of {', '.join(known)}, or a suite's file"
        raise InputError("no such suite", value=text, expected=expected)
    return Suite.from_document(parse_json(read_text(Path(text)), text), text)
