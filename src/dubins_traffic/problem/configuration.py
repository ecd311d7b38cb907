"""Trials configurations: version 0 as in 2016, and version 1, a superset of it."""

from __future__ import annotations

import os
from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from importlib.resources import files
from pathlib import Path
from typing import Any

from dubins_traffic.cars.body import Car
from dubins_traffic.cars.state import Pose
from dubins_traffic.display import count
from dubins_traffic.errors import InputError
from dubins_traffic.files import exists, is_file
from dubins_traffic.kernels.angles import sincos
from dubins_traffic.problem.faults import parse, version_of
from dubins_traffic.problem.files import FileKind, Source, plain, read_source
from dubins_traffic.problem.instance import EAgent
from dubins_traffic.problem.kinds import kind_of, parameters_of
from dubins_traffic.problem.settings import VERSION_0_KEYS, AgentEntry, Settings, Settings0
from dubins_traffic.roads.network import RoadNetwork


@dataclass(frozen=True, slots=True)
class PlannedAgent:
    """An e-agent of a document: the e-agent, its start (None: drawn), and the path of its entry."""

    agent: EAgent
    start: Pose | None
    field: str


@dataclass(frozen=True, slots=True)
class Configuration:
    """A checked trials configuration.

    Parameters
    ----------
    document : Mapping
        The document as it was read; `to_document` gives it back.
    settings : Settings
        All settings, with defaults.
    network : RoadNetwork or None
        The road network, if it is the same in all trials.
    agents : tuple of PlannedAgent
        The e-agents, counts multiplied out.
    file : str or None
        The file from which it was read.
    network_file : str or None
        The file from which its road network was read, if it names one.
    """

    document: Mapping[str, Any]
    settings: Settings
    network: RoadNetwork | None
    agents: tuple[PlannedAgent, ...]
    file: str | None = None
    network_file: str | None = None
    kept: dict[str, object] = field(default_factory=dict[str, object], init=False, repr=False, compare=False)
    """What has been worked out of the rest once; not part of it, and left behind when it is pickled."""

    def __repr__(self) -> str:
        parts = [
            self.file or "a document",
            "drawn networks" if self.network is None else self.network.summary,
            count(len(self.agents), "e-agent"),
            count(self.number_trials, "trial"),
        ]
        return f"<Configuration: {', '.join(parts)}>"

    def __reduce__(self) -> tuple[object, ...]:
        parts = self.document, self.settings, self.network, self.agents, self.file, self.network_file
        return Configuration, parts

    @staticmethod
    def from_document(
        document: Mapping[str, Any],
        file: str | None = None,
        folder: Path | None = None,
        rnd: str | os.PathLike[str] | None = None,
    ) -> Configuration:
        """Check `document`; a relative path in `rnd` is looked up in `folder`, then in the current directory.

        Parameters
        ----------
        document : Mapping
            A trials configuration, version 0 or 1.
        file : str, optional
            Named in messages.
        folder : Path, optional
            The folder in which the configuration stands.
        rnd : path, optional
            A road network description that overrides the document's.

        Raises
        ------
        InputError
            For the first thing wrong, with its field.
        """
        given = plain(document, file)
        if rnd is not None:
            given.pop("network", None)
            given["rnd"] = os.fspath(rnd)
            folder = None
        settings = settings_of(given, file)
        try:
            network_file = _network_file(settings, folder)
            network = _network(settings, network_file)
            agents = plan_agents(settings.e_agents)
            if network is not None:
                for k, goal in enumerate(settings.goals or ()):
                    check_goal(network, goal, k)
        except InputError as error:
            raise error.within(file=file) from None
        return Configuration(given, settings, network, agents, file, network_file)

    def with_simulator(self, name: str) -> Configuration:
        """Return the configuration with another simulator; its document stays as it was read."""
        return replace(self, settings=self.settings.model_copy(update={"simulator": name}))

    def to_document(self) -> dict[str, Any]:
        """Return the document, equal to the one that was read."""
        return deepcopy(dict(self.document))

    def inlined(self) -> dict[str, Any]:
        """Return the document with the road network written in that it names by path."""
        document = self.to_document()
        if self.network is not None and not isinstance(document.get("rnd"), dict):
            document.pop("network", None)
            document["rnd"] = self.network.to_document()
        return document

    @property
    def version(self) -> int:
        """Version of the document, 0 or 1."""
        return self.document["version"]

    @property
    def number_trials(self) -> int:
        """Number of trials (1 where the document gives none)."""
        return self.settings.number_trials

    @property
    def car(self) -> Car:
        """The car; all cars are alike."""
        return self.settings.car.core()


def load_config(
    source: str | os.PathLike[str] | Mapping[str, Any], rnd: str | os.PathLike[str] | None = None
) -> Configuration:
    """Return the trials configuration at `source`: a file, the name of a shipped one, ``-``, or a document.

    Parameters
    ----------
    source : path, str or Mapping
        A file is preferred to a shipped configuration of the same name.
    rnd : path, optional
        A road network description that overrides the configuration's.

    Raises
    ------
    InputError
        If there is no such configuration or something in it is wrong.
    """
    if isinstance(source, Mapping):
        return Configuration.from_document(source, rnd=rnd)
    text = find_source(source)
    wanted = "a trials configuration", "problem_domain, rnd, e-agents, ..."
    document = text.document(FileKind.CONFIGURATION, *wanted)
    return Configuration.from_document(document, text.name, text.folder, rnd)


def find_source(name: str | os.PathLike[str]) -> Source:
    """Return the file called `name`, else the shipped configuration of that name.

    Raises
    ------
    InputError
        If there is neither.
    """
    text = os.fspath(name)
    if text in shipped_names() and not is_file(text):
        item = files("dubins_traffic.problem") / "configurations" / f"{text}.json"
        return Source(text, None, item.read_text(encoding="utf-8"))
    if text != "-" and not exists(text) and not Path(text).suffix and os.sep not in text:
        known = ", ".join(shipped_names())
        raise InputError("no such file or shipped configuration", file=text, expected=f"a file or one of {known}")
    return read_source(text)


def shipped_names() -> list[str]:
    """Return the names of the shipped configurations."""
    folder = files("dubins_traffic.problem") / "configurations"
    return sorted(item.name.removesuffix(".json") for item in folder.iterdir() if item.name.endswith(".json"))


def check_goal(network: RoadNetwork, goal: list[float] | tuple[float, ...], index: int) -> tuple[float, float]:
    """Return the `index`-th goal as a lattice point.

    Raises
    ------
    InputError
        If it is no intersection of the network.
    """
    point = (goal[0], goal[1])
    try:
        network.vertex(point)
    except InputError:
        raise InputError(
            "goal is off the network",
            field=f"goals[{index}]",
            value=list(point),
            expected="an intersection of the road network",
        ) from None
    return point


def pose_of(x: float, y: float, theta: float) -> Pose:
    """Return the pose at (x, y) with heading `theta`, radians."""
    cosine, sine = sincos(theta)
    return Pose(x, y, cosine, sine)


def settings_of(document: Mapping[str, Any], file: str | None = None) -> Settings:
    """Return the settings of a document, without reading its road network; InputError if one is wrong."""
    if version_of(document, file) == 0:
        parse(Settings0, document, file=file)
        known = {key: value for key, value in document.items() if key in VERSION_0_KEYS}
        entries = known.get("e-agents", [])
        known["e-agents"] = [{"type": entry["type"], "name": entry["name"]} for entry in entries]
        return parse(Settings, {**known, "ego": {"start": "origin"}}, file=file)
    return parse(Settings, document, file=file)


def _network_file(settings: Settings, folder: Path | None) -> str | None:
    """Return the file that the settings name as their road network, ``-`` for standard input, None for no file."""
    file = None if settings.network is None else settings.network.file
    field, rnd = ("rnd", settings.rnd) if file is None else ("network.file", file)
    if not isinstance(rnd, str) or rnd == "-":
        return rnd if isinstance(rnd, str) else None
    beside = (folder or Path()) / rnd
    path = beside if is_file(beside) else Path(rnd)
    if not exists(path):
        expected = "a file beside the configuration or in the current directory"
        raise InputError("no such file", field=field, value=rnd, expected=expected)
    return str(path)


def _network(settings: Settings, file: str | None) -> RoadNetwork | None:
    """Return the network of all trials, read from `file` if one is named; None where each draws its own."""
    if file is not None:
        return RoadNetwork.read(file)
    if settings.rnd is None:
        return None
    try:
        return RoadNetwork.from_document(settings.rnd)
    except InputError as error:
        raise error.within(field="rnd") from None


def plan_agents(entries: list[AgentEntry]) -> tuple[PlannedAgent, ...]:
    """Return the e-agents that `entries` of a document stand for, counts multiplied out."""
    agents: list[PlannedAgent] = []
    taken: dict[str, str] = {}
    counters: dict[str, int] = {}
    for k, entry in enumerate(entries):
        where = f"e-agents[{k}]"
        try:
            kind = kind_of(entry.type)
            parameters = parameters_of(kind, entry.parameters)
        except InputError as error:
            raise error.within(field=where) from None
        start = pose_of(*entry.start) if entry.start is not None else None
        for name in _names(entry, counters):
            if name == "ego" or name in taken:
                problem = "an e-agent can't be called ego" if name == "ego" else f"name taken by {taken[name]}"
                raise InputError(problem, field=f"{where}.name", value=name, expected="a name of its own")
            taken[name] = where
            agents.append(PlannedAgent(EAgent(kind, name, entry.type, parameters), start, where))
    return tuple(agents)


def _names(entry: AgentEntry, counters: dict[str, int]) -> list[str]:
    if entry.count is None:
        return [entry.name]
    first = counters.get(entry.name, 0)
    counters[entry.name] = first + entry.count
    return [f"{entry.name}{k}" for k in range(first, first + entry.count)]
