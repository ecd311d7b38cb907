"""What a manifest of a campaign holds, as far as it is read again."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from dubins_traffic.problem.faults import Open


class Placed(Open):
    """A controller or a metric: its name, where it is, and the SHA-256 of its file if it is one."""

    name: str
    place: str
    file: str | None


class ColumnModel(Open):
    """A column of a further metric (`scoring.metric.Column`)."""

    name: str
    label: str
    short: str
    unit: str
    better: Literal[-1, 0, 1]
    kind: str
    rare: bool
    bounded: bool
    meaning: str


class ManifestModel(Open):
    """A manifest. It tells the hash of the campaign, which must be that of the file beside it."""

    format: int
    trials: int
    records: str
    campaign: str
    configurations: dict[str, str]
    controllers: list[Placed] = Field(min_length=1)
    metrics: list[Placed] = Field(default=[])
    columns: list[ColumnModel] = Field(default=[])
    versions: dict[str, str]
    code: str
