"""A suite: its document, its hash, and the campaign that runs it with given controllers."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.errors import InputError
from dubins_traffic.files import is_file, read_text
from dubins_traffic.problem.faults import parse
from dubins_traffic.problem.files import parse_json, plain
from dubins_traffic.suites.settings import SuiteModel

SHORT = 12
"""Digits of a hash in the names of files."""
_TOLD = ("title", "version")
"""Fields that may change without a change of the problems or their scores; the hash leaves them out."""


@dataclass(frozen=True)
class Suite:
    """A checked suite.

    Attributes
    ----------
    document : Mapping
        What its file says.
    model : SuiteModel
        The same, checked, with defaults.
    file : str or None
        The file from which it was read; None for a shipped suite.
    """

    document: Mapping[str, Any]
    model: SuiteModel
    file: str | None = field(default=None, compare=False)

    @staticmethod
    def from_document(document: Mapping[str, Any], file: str | None = None) -> Suite:
        """Check a document; InputError for the first thing wrong, with its field."""
        own = plain(document, file)
        suite = Suite(own, parse(SuiteModel, own, file=file), file)
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
        told = {name: value for name, value in self.document.items() if name not in _TOLD}
        if "campaign" in told:
            told["campaign"] = {
                name: value for name, value in told["campaign"].items() if name != "controllers"
            }
        return hashlib.sha256(json.dumps(told, sort_keys=True, separators=(",", ":")).encode()).hexdigest()

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
        controllers : sequence of str
            The controllers to run.
        trials : int, optional
            Number of trials of each combination, if only the first ones are to be run.
        places : tuple of str, optional
            The full names of the controllers, if they are not to be loaded.

        Raises
        ------
        InputError
            If the suite is one of games, a controller can't be loaded, or it has not so many trials.
        """
        own = self.document.get("campaign")
        if own is None or self.trials is None:
            raise InputError("a suite of another kind, which is no campaign", file=self.file or self.name)
        if trials is not None and not 1 <= trials <= self.trials:
            raise InputError(
                "not a number of its trials", file="--trials", value=trials, expected=f"1 to {self.trials}"
            )
        document = {
            **own,
            "name": self.label,
            "trials": trials or self.trials,
            "controllers": list(controllers),
        }
        return Campaign.from_document(document, self.file or self.name, places=places)


def shipped_suites() -> list[str]:
    """Return the names of the suites that are shipped."""
    found = (item.name for item in (files("dubins_traffic.suites") / "data").iterdir())
    return sorted(name.removesuffix(".json") for name in found if name.endswith(".json"))


def load_suite(name: str | os.PathLike[str]) -> Suite:
    """Return the suite of a shipped name, or in a file.

    Raises
    ------
    InputError
        If there is none, or something in it is wrong.
    """
    text = os.fspath(name)
    known = shipped_suites()
    if text in known:
        shipped = files("dubins_traffic.suites") / "data" / f"{text}.json"
        return Suite.from_document(parse_json(shipped.read_text(encoding="utf-8"), text))
    if not is_file(text):
        expected = f"one of {', '.join(known)}, or a suite's file"
        raise InputError("no such suite", value=text, expected=expected)
    return Suite.from_document(parse_json(read_text(Path(text)), text), text)
