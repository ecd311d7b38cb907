"""The manifest of a campaign's folder: the campaign, its inputs' hashes and the versions of libraries."""

from __future__ import annotations

import hashlib
import json
import platform
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Literal, cast

from pydantic import Field

from dubins_traffic.campaign.campaign import Campaign
from dubins_traffic.errors import InputError
from dubins_traffic.files import read_text, replace_file
from dubins_traffic.problem.faults import Open, parse
from dubins_traffic.problem.files import parse_json
from dubins_traffic.release import sources_hash
from dubins_traffic.scoring.metric import Column

FORMAT = 0
NAME = "manifest.json"
CAMPAIGN = "campaign.json"
OURS = "dubins-traffic"
LIBRARIES = ("mcap", "numba", "numpy", "pyarrow")


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


def make(campaign: Campaign, records: str) -> dict[str, Any]:
    """Return the manifest of a campaign that begins now.

    Parameters
    ----------
    campaign : Campaign
        What is to be run.
    records : str
        Which records are kept, as on the command line.
    """
    places = zip(campaign.controllers, campaign.places, strict=True)
    metrics = [
        {"name": spec, "place": place, "file": hash_of_file(place)}
        for spec, place in zip(campaign.model.metrics, campaign.metrics, strict=True)
    ]
    columns = [asdict(column) for column in campaign.columns]
    return {
        "format": FORMAT,
        "name": campaign.model.name,
        "trials": campaign.total,
        "records": records,
        "campaign": _hash(campaign.document),
        "configurations": {entry["name"]: _hash(entry["document"]) for entry in campaign.document["configurations"]},
        "controllers": [{"name": name, "place": place, "file": hash_of_file(place)} for name, place in places],
        **({"metrics": metrics, "columns": columns} if metrics else {}),
        "versions": {OURS: package_version(), "python": platform.python_version(), **_versions()},
        "code": sources_hash(),
    }


def _versions() -> dict[str, str]:
    """Return the versions of the libraries that are installed; machine code is there without Numba, too."""
    versions: dict[str, str] = {}
    for name in LIBRARIES:
        with suppress(PackageNotFoundError):
            versions[name] = version(name)
    return versions


def write(folder: Path, campaign: Campaign, manifest: Mapping[str, Any]) -> None:
    """Write the campaign and then its manifest, which makes the folder that of a campaign."""
    for name, document in ((CAMPAIGN, campaign.document), (NAME, manifest)):
        text = json.dumps(document, indent=1) + "\n"
        replace_file(folder / name, _writer(text.encode()), durable=True)


def read(folder: Path) -> dict[str, Any] | None:
    """Return the manifest in `folder`; None if there is none."""
    path = folder / NAME
    if not path.is_file():
        return None
    manifest = parse_json(read_text(path), str(path))
    if manifest.get("format") != FORMAT:
        raise InputError(
            "unknown format",
            file=str(path),
            field="format",
            value=manifest.get("format"),
            expected=str(FORMAT),
        )
    told = parse(ManifestModel, manifest, file=str(path))
    if OURS not in told.versions:
        raise InputError("missing", file=str(path), field=f"versions.{OURS}", expected="this key")
    return manifest


def stored_document(folder: Path) -> dict[str, Any]:
    """Return the document of the campaign in `folder`: the campaign file with its configurations written in."""
    path = folder / CAMPAIGN
    return parse_json(read_text(path), str(path))


def stored_campaign(folder: Path, manifest: Mapping[str, Any]) -> Campaign:
    """Return the campaign of `folder`, checked anew."""
    document = stored_document(folder)
    if _hash(document) != manifest["campaign"]:
        raise InputError(
            "changed since the campaign began",
            file=str(folder / CAMPAIGN),
            expected="it as it was, or a new folder",
        )
    places = tuple(entry["place"] for entry in manifest["controllers"])
    if len(places) != len(document["controllers"]):
        expected = f"{len(document['controllers'])} entries, as in {CAMPAIGN}"
        raise InputError("other controllers", file=str(folder / NAME), field="controllers", expected=expected)
    metrics = tuple(entry["place"] for entry in manifest.get("metrics", []))
    columns = tuple(Column(**entry) for entry in manifest.get("columns", []))
    return Campaign.from_document(document, str(folder / CAMPAIGN), places=places, metrics=(metrics, columns))


def check_same(folder: Path, campaign: Campaign, records: str | None) -> dict[str, Any]:
    """Return the manifest of `folder`, after checking that it was begun with `campaign`.

    Parameters
    ----------
    folder : Path
        A campaign's folder, with a manifest.
    campaign : Campaign
        What is to be resumed.
    records : str or None
        Which records are kept; None: as before.
    """
    manifest = read(folder) or {}
    difference = _difference(stored_document(folder), campaign.document, "")
    if difference is not None:
        raise _changed(campaign.file, difference[0], difference[2], difference[1])
    now = make(campaign, records or manifest["records"])
    for what in ("controllers", "metrics"):
        there = manifest.get(what, [])
        for k, after in enumerate(now.get(what, [])):
            before = there[k] if k < len(there) else {"file": None}
            if before["file"] != after["file"]:
                name = f"{what}[{k}] ({after['place']})"
                raise _changed(campaign.file, name, after["file"] or "no file", before["file"] or "no file")
    if now["records"] != manifest["records"]:
        raise _changed("--records", None, now["records"], manifest["records"])
    if now["versions"][OURS] != manifest["versions"][OURS]:
        raise _changed(str(folder / NAME), f"versions.{OURS}", now["versions"][OURS], manifest["versions"][OURS])
    return manifest


_ABSENT = "nothing"


def _changed(file: str | None, field: str | None, now: object, before: object) -> InputError:
    expected = f"{json.dumps(before)[:80]}, or a new folder"
    return InputError("changed since the campaign began", file=file, field=field, value=now, expected=expected)


def _difference(before: Any, now: Any, path: str) -> tuple[str, Any, Any] | None:
    """Return the path of the first field in which two documents differ, with both values."""
    if isinstance(before, Mapping) and isinstance(now, Mapping):
        old, new = cast("Mapping[str, Any]", before), cast("Mapping[str, Any]", now)
        for key in dict.fromkeys([*old, *new]):
            below = f"{path}.{key}" if path else key
            deeper = _difference(old.get(key, _ABSENT), new.get(key, _ABSENT), below)
            if deeper is not None:
                return deeper
        if list(old) != list(new) and path in ("factors", "fields"):
            return path, list(old), list(new)
        return None
    if isinstance(before, list) and isinstance(now, list):
        first, second = cast("Sequence[Any]", before), cast("Sequence[Any]", now)
        if len(first) == len(second):
            pairs = enumerate(zip(first, second, strict=True))
            deeper = (_difference(one, other, f"{path}[{k}]") for k, (one, other) in pairs)
            return next((each for each in deeper if each is not None), None)
    same = type(before) is type(now) and before == now  # pyright: ignore[reportUnknownArgumentType]
    return None if same else (path, before, now)  # pyright: ignore[reportUnknownVariableType]


def _hash(document: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def hash_of_file(place: str) -> str | None:
    """Return the hash of a controller's file, None if it is given by name."""
    path = Path(place.rpartition(":")[0])
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.suffix == ".py" and path.is_file() else None


def package_version() -> str:
    """Return the version of this package."""
    return version(OURS)


def _writer(data: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(data)
