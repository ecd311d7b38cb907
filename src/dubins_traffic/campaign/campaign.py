"""A campaign: which trials it consists of, in which order, and from which seeds."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import product
from pathlib import Path
from typing import Any, cast

from dubins_traffic import outside
from dubins_traffic.campaign.chunks import Cell, Chunk, cut
from dubins_traffic.campaign.rows import RESULT, WALL
from dubins_traffic.campaign.settings import (
    MOST_CELLS,
    MOST_TRIALS,
    CampaignModel,
    ConfigurationEntry,
    Scalar,
    levels,
    scalar,
    vary,
)
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.files import is_file
from dubins_traffic.problem.configuration import Configuration, load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.faults import parse
from dubins_traffic.problem.files import plain, read_toml
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.header import bare_name
from dubins_traffic.scoring import registry as scores
from dubins_traffic.scoring.metric import Column
from dubins_traffic.simulators import registry as simulators


@dataclass(frozen=True)
class Campaign:
    """A checked campaign.

    Parameters
    ----------
    document : Mapping
        The campaign file as JSON, with the configurations and their road networks written in.
    model : CampaignModel
        The same, checked, with defaults filled in.
    places : tuple of str
        The controllers; those given by a file have its full path.
    cells : tuple of Cell
        All combinations, configurations outermost.
    metrics : tuple of str
        The further metrics; those given by a file have its full path.
    columns : tuple of Column
        The columns of these metrics.
    file : str or None
        The file from which it was read.

    Notes
    -----
    Trials are numbered cell by cell, in a cell controller by controller.
    """

    document: Mapping[str, Any]
    model: CampaignModel
    places: tuple[str, ...]
    cells: tuple[Cell, ...]
    metrics: tuple[str, ...] = ()
    columns: tuple[Column, ...] = ()
    file: str | None = field(default=None, compare=False)

    @staticmethod
    def from_document(
        document: Mapping[str, Any],
        file: str | None = None,
        folder: Path | None = None,
        places: tuple[str, ...] | None = None,
        metrics: tuple[tuple[str, ...], tuple[Column, ...]] | None = None,
    ) -> Campaign:
        """Check `document`; relative paths are looked up in `folder`, then in the current directory.

        Parameters
        ----------
        document : Mapping
            A campaign file, as JSON.
        file : str, optional
            Named in messages.
        folder : Path, optional
            The folder in which the file stands.
        places : tuple of str, optional
            The controllers, in place of those that the document names.
        metrics : (tuple of str, tuple of Column), optional
            The further metrics and their columns, in place of those that the document names.
        """
        given = plain(document, file)
        model = parse(CampaignModel, given, file=file)
        try:
            configurations = [configuration_of(entry, k, folder) for k, entry in enumerate(model.configurations)]
            check_names([entry.name for entry in model.configurations], "configurations")
            check_names([bare_name(spec) for spec in model.controllers], "controllers")
            named = places or tuple(_place(spec, k, folder) for k, spec in enumerate(model.controllers))
            if places is None:
                model = model.model_copy(update={"metrics": list(scores.with_share(model.metrics, named))})
            further = metrics or _metrics(model.metrics, folder)
            cells = tuple(_cells(model, configurations))
        except InputError as error:
            raise error.within(file=file) from None
        return Campaign(_complete(model, configurations), model, named, cells, *further, file)

    @property
    def controllers(self) -> tuple[str, ...]:
        """The names of the controllers in tables."""
        return tuple(bare_name(spec) for spec in self.model.controllers)

    @property
    def total(self) -> int:
        """Number of trials, all controllers together."""
        return len(self.places) * sum(cell.count for cell in self.cells)

    @cached_property
    def factors(self) -> tuple[str, ...]:
        """Names of the factors, in the order of the table's columns."""
        return tuple(self.cells[0].values)

    def first_trials(self) -> Iterator[Callable[[], Instance]]:
        """Yield what draws the first trial of each cell, in order."""
        for cell in self.cells:
            yield partial(draw, cell.settled, cell.seed, 0)

    def chunks(self) -> Iterator[Chunk]:
        """Yield all chunks, in order; they depend on the campaign alone."""
        return cut(self.cells, self.places, self.model.chunk, self.model.deadline, self.metrics)

    def chunk(self, cell: Cell, controller: int, trial: int) -> Chunk:
        """Return one trial as a chunk of its own."""
        number = cell.first + controller * cell.count + trial
        place, deadline = self.places[controller], self.model.deadline
        return Chunk(number, cell.settled, cell.seed, place, trial, 1, deadline, self.metrics)


def load_campaign(path: str | os.PathLike[str], *, sandbox: str | None = None) -> Campaign:
    """Return the campaign in the TOML file at `path`.

    Parameters
    ----------
    path : path
        A campaign file.
    sandbox : str, optional
        Limits of a box for each controller (`controllers.registry.sandboxed`); by default they run as the file names
        them.
    """
    name = os.fspath(path)
    document = read_toml(name, "a campaign file, TOML")
    specs: Any = document.get("controllers")
    if sandbox is not None and isinstance(specs, list):
        named = cast("list[Any]", specs)
        document["controllers"] = [
            controllers.sandboxed(spec, sandbox) if isinstance(spec, str) else spec for spec in named
        ]
    return Campaign.from_document(document, name, Path(name).parent)


def seed_of(root: int, configuration: str, values: Mapping[str, Scalar]) -> int:
    """Return the seed of a cell: 64 bits of SHA-256 over the root seed, the configuration's name and the factors.

    It does not depend on controllers and other cells, so these can be added without a change of instances.
    """
    text = json.dumps([root, configuration, dict(sorted(values.items()))], separators=(",", ":"))
    return int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "little")


def configuration_of(entry: ConfigurationEntry, index: int, folder: Path | None) -> Configuration:
    """Return the configuration that entry number `index` names; InputError, with its field, if it is wrong."""
    where = f"configurations[{index}]"
    try:
        if entry.document is not None:
            return Configuration.from_document(entry.document, folder=folder)
        name = entry.file or ""
        beside = (folder or Path()) / name
        return load_config(beside if is_file(beside) else name)
    except InputError as error:
        problem = ": ".join(part for part in (error.file, error.field, error.problem) if part)
        raise InputError(problem, field=where, value=error.value, expected=error.expected) from None


def _place(spec: str, index: int, folder: Path | None) -> str:
    """Return a controller's name, with the full path if it is a file; it is loaded once to check it."""
    spec = outside.resolved(spec, folder)
    try:
        controllers.load(spec)
    except InputError as error:
        raise InputError(
            error.problem, field=f"controllers[{index}]", value=error.value, expected=error.expected
        ) from None
    return spec


def _metrics(specs: list[str], folder: Path | None) -> tuple[tuple[str, ...], tuple[Column, ...]]:
    """Return the metrics' names, with full paths if they are files, and their columns; each is loaded once."""
    places = tuple(outside.resolved(spec, folder) for spec in specs)
    columns: list[Column] = []
    for k, place in enumerate(places):
        taken = [*RESULT, *WALL, *(column.name for column in columns)]
        try:
            columns += scores.columns([place], taken)
        except InputError as error:
            raise InputError(error.problem, field=f"metrics[{k}]", value=error.value, expected=error.expected) from None
    return places, tuple(columns)


def check_names(names: list[str], what: str) -> None:
    """Refuse a name that stands twice in the field `what`."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise InputError("name taken", field=f"{what}[{k}]", value=name, expected="a name of its own")


def _cells(model: CampaignModel, configurations: list[Configuration]) -> Iterator[Cell]:
    factors = levels(model.factors)
    axes = {**factors, **model.fields}
    _check_axes(axes, model, len(configurations))
    first, index = 0, 0
    for k, configuration in enumerate(configurations):
        name = model.configurations[k].name
        for values in product(*axes.values()):
            chosen = dict(zip(axes, values, strict=True))
            scalars = {axis: scalar(value) for axis, value in chosen.items()}
            settled = _settled(configuration, chosen, set(factors), f"configurations[{k}]", scalars)
            count = model.trials or settled.number_trials
            yield Cell(index, name, scalars, seed_of(model.seed, name, scalars), first, count, settled)
            first += count * len(model.controllers)
            index += 1
            if first > MOST_TRIALS:
                raise InputError(
                    "too many trials", field="trials", value=first, expected=f"at most {MOST_TRIALS} in all"
                )


def _check_axes(axes: Mapping[str, list[Any]], model: CampaignModel, configurations: int) -> None:
    count = configurations
    for name, values in axes.items():
        field_ = f"fields.{name}" if name in model.fields else f"factors.{name}"
        scalars = [scalar(value) for value in values]
        for k, value in enumerate(scalars):
            if (type(value), value) in [(type(other), other) for other in scalars[:k]]:
                raise InputError("value stands twice", field=f"{field_}[{k}]", value=value, expected="each value once")
        count *= len(values)
    if count > MOST_CELLS:
        expected = f"at most {MOST_CELLS} of them with the configurations"
        raise InputError("too many combinations", field="factors", value=count, expected=expected)


def _settled(
    configuration: Configuration,
    chosen: Mapping[str, Any],
    factors: set[str],
    field_: str,
    scalars: Mapping[str, Scalar],
) -> Configuration:
    """Return the configuration with the chosen values put in, checked."""
    named = {name: value for name, value in chosen.items() if name in factors}
    rest = {name: value for name, value in chosen.items() if name not in factors}
    with_ = ", ".join(f"{name} = {value}" for name, value in scalars.items())
    try:
        document = vary(configuration.inlined(), named, rest)
        settled = Configuration.from_document(document)
        simulators.load(settled.settings.simulator).close()
    except InputError as error:
        problem = ": ".join(part for part in (error.field, error.problem) if part)
        where = f"{field_} with {with_}" if with_ else field_
        raise InputError(problem, field=where, value=error.value, expected=error.expected) from None
    return settled


def _complete(model: CampaignModel, configurations: list[Configuration]) -> dict[str, Any]:
    document = model.model_dump(exclude={"configurations"})
    if not model.metrics:
        del document["metrics"]
    document["factors"] = levels(model.factors)
    document["configurations"] = [
        {"name": entry.name, "document": configuration.inlined()}
        for entry, configuration in zip(model.configurations, configurations, strict=True)
    ]
    return document
