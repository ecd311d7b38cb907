"""A competition: what its file says, its phases, and which trials each of them consists of."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, date, datetime, time
from pathlib import Path
from typing import Any, Literal, cast

from dubins_traffic.campaign.campaign import check_names, configuration_of
from dubins_traffic.competition.sealing import secret_seeds
from dubins_traffic.competition.settings import (
    MOST_TRIALS,
    SECRET,
    CompetitionModel,
    Limits,
    PhaseModel,
    Quota,
    Ranking,
)
from dubins_traffic.errors import InputError
from dubins_traffic.problem.configuration import Configuration
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.faults import parse
from dubins_traffic.problem.files import plain, read_toml
from dubins_traffic.problem.instance import Instance
from dubins_traffic.scoring.icra2016 import weight_of


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

    Attributes
    ----------
    name : str
        Such as ``test``.
    model : PhaseModel
        What the file says of it.
    configurations : tuple of Named
        Those of its trials.
    ranking : Ranking
        What ranks its entries.
    folder : Path or None
        Where sealed and revealed seeds lie; None for a competition that is no file.
    """

    name: str
    model: PhaseModel
    configurations: tuple[Named, ...]
    ranking: Ranking
    folder: Path | None = None

    @property
    def opens(self) -> datetime | None:
        """What is received from this time on counts; None: always."""
        return self.model.opens

    @property
    def closes(self) -> datetime | None:
        """What is received before this time counts; None: for ever."""
        return self.model.closes

    @property
    def limits(self) -> Limits:
        """What a submission may use in one trial."""
        return self.model.limits

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
                    {"name": own.name, "document": own.configuration.inlined()} for own in self.configurations
                ],
                "trials": self.model.trials,
                "limits": self.limits.model_dump(),
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


@dataclass(frozen=True, slots=True)
class Competition:
    """A checked competition.

    Attributes
    ----------
    document : Mapping
        What the file says, with the configurations and their road networks written in; JSON.
    model : CompetitionModel
        The same, checked, with defaults.
    configurations : tuple of Named
        All of them.
    file : str or None
        Where it was read; named in messages.
    folder : Path or None
        Where sealed and revealed seeds lie: the folder of the file.
    """

    document: Mapping[str, Any]
    model: CompetitionModel
    configurations: tuple[Named, ...]
    file: str | None = field(default=None, compare=False)
    folder: Path | None = field(default=None, compare=False)

    @staticmethod
    def from_document(
        document: Mapping[str, Any], file: str | None = None, folder: Path | None = None
    ) -> Competition:
        """Check `document`; relative paths are looked up in `folder`, then in the current directory.

        Raises
        ------
        InputError
            For the first thing wrong, with its field.
        """
        own = plain(_dated(document), file)
        model = parse(CompetitionModel, own, file=file)
        try:
            check_names([entry.name for entry in model.configurations], "configurations")
            found = tuple(
                Named(entry.name, configuration_of(entry, k, folder))
                for k, entry in enumerate(model.configurations)
            )
            made = Competition(_complete(own, found), model, found, file, folder)
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

        Raises
        ------
        InputError
            If there is none, or it names a configuration that there is not.
        """
        model = self.model.phases.get(name)
        if model is None:
            expected = f"one of {', '.join(self.model.phases)}"
            raise InputError("no such phase", file=self.file, field="phases", value=name, expected=expected)
        known = {own.name: own for own in self.configurations}
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

    Raises
    ------
    InputError
        If there is no such file or something in it is wrong.
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
    entries = [{"name": own.name, "document": own.configuration.inlined()} for own in configurations]
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
    check_names([own.name for own in phase.configurations], f"{where}.configurations")
    if phase.ranking.metric == "icra2016":
        for own in phase.configurations:
            if weight_of(draw(own.configuration)) is None:
                raise InputError(
                    "the score of ICRA 2016 is not defined here",
                    field="ranking.metric",
                    value=own.name,
                    expected="configurations on a grid, whose e-agents are called agent...",
                )
