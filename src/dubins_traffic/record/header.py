"""The header of a record: the only place where records know the instance document."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import PurePath
from typing import Any, Final, cast

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record import schema

PACKAGE: Final = "dubins-traffic"


@dataclass(frozen=True, slots=True)
class Header:
    """What stands before the first frame. `versions` holds the package's under its name, then the libraries'."""

    instance: Instance
    controller: str | None
    versions: Mapping[str, str]


def bare_name(controller: str) -> str:
    """Return the name of a controller without the folders of a path: ``file.py:Class``."""
    return PurePath(controller).name


def encode(instance: Instance, controller: str | None, versions: Mapping[str, str] | None = None) -> bytes:
    """Return the message on ``/trial``, the same bytes for the same instance, controller and versions.

    Of a controller given by a file's path only the last part of the path is kept (`bare_name`). The versions are those
    of this package and of the encoding library unless given.
    """
    return as_message(document(instance, controller, versions))


def as_message(document: Mapping[str, Any]) -> bytes:
    """Return a document as the text of the message on ``/trial``."""
    return json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()


def document(instance: Instance, controller: str | None, versions: Mapping[str, str] | None = None) -> dict[str, Any]:
    """Return the document that `encode` encodes."""
    bounds = instance.problem.car.bounds
    if versions is None:
        versions = {PACKAGE: version(PACKAGE), "mcap": version("mcap")}
    return {
        "format": schema.FORMAT,
        "version": schema.VERSION,
        "package": versions[PACKAGE],
        "libraries": {name: text for name, text in versions.items() if name != PACKAGE},
        "seed": instance.seed,
        "trial": instance.trial,
        "controller": None if controller is None else bare_name(controller),
        "rate": instance.problem.rate,
        "cars": list(instance.names),
        "bounds": {
            "speed": bounds.speed,
            "speed_min": bounds.speed_low,
            "yaw_rate": bounds.yaw_rate,
            "turning_radius": bounds.turning_radius,
        },
        "instance": instance_to_document(instance),
    }


def decode(data: bytes, file: str | None = None) -> Header:
    """Return the header that `data` encodes.

    Raises
    ------
    RecordError
        If it is not the header of a record, or one of a version that this package does not know.
    """
    try:
        header: Any = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise RecordError("damaged header", file=file, expected="JSON") from error
    fields = cast("dict[str, Any]", header) if isinstance(header, dict) else {}
    if fields.get("format") != schema.FORMAT:
        raise RecordError("not a record of a trial", file=file, expected=f"an MCAP file with {schema.HEADER}")
    if fields.get("version") != schema.VERSION:
        raise RecordError(
            "unknown version of the record",
            file=file,
            field="version",
            value=fields.get("version"),
            expected=str(schema.VERSION),
        )
    for name, kind in (("package", str), ("libraries", dict), ("instance", dict), ("controller", str | None)):
        if name not in fields or not isinstance(fields[name], kind):
            value = fields.get(name)
            raise RecordError("missing from the header or of a wrong type", file=file, field=name, value=value)
    try:
        instance = instance_from_document(fields["instance"])
    except InputError as error:
        placed = error.within(field="instance")
        raise RecordError(f"{placed.field}: {placed.problem}", file=file, expected=placed.expected) from error
    versions = {**fields["libraries"], PACKAGE: fields["package"]}
    return Header(instance, fields["controller"], versions)
