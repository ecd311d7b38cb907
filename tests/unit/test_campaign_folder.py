"""The folder of a campaign: what it refuses, and what it makes of whatever a killed process leaves there."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyarrow import parquet

from dubins_traffic.campaign import manifest, rows
from dubins_traffic.campaign.campaign import Campaign, load_campaign
from dubins_traffic.campaign.folder import Folder, Keep, Records, opened, read_keep
from dubins_traffic.campaign.run_campaign import run_chunk
from dubins_traffic.errors import DubinsTrafficError, InputError
from tests.campaigns import campaign, written

SHORT = campaign(controllers=["simple"], trials=4, factors={"duration": [0.1], "e_agents": [0, 1]})


@pytest.fixture(scope="module")
def short() -> Campaign:
    return Campaign.from_document(SHORT)


def fill(folder: Folder) -> None:
    """Run all trials here."""
    for chunk in folder.campaign.chunks():
        folder.keep(chunk, rows.encoded(run_chunk(chunk)))


def names(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


def test_whatever_was_left_is_taken_up(short: Campaign, tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    with opened(whole, short, resume=False, records=None) as own:
        assert own.done() == []
        fill(own)
        first = whole / "parts" / "000000000-000000002.parquet"
        data = first.read_bytes()
        assert own.done()[:2] == [(0, 3), (3, 4)]
    first.write_bytes(data[:-10])
    (whole / "parts" / ".000000003-000000003.parquet.77.tmp").write_bytes(b"half")
    with opened(whole, short, resume=True, records=None) as own:
        assert own.done() == [(3, 4), (4, 7), (7, 8)]
        assert not first.exists()
        with pytest.raises(InputError, match="rows are missing or stand twice"):
            own.finish()
        assert not (whole / "results.parquet").exists()
        first.write_bytes(data)
        own.finish()
        table = (whole / "results.parquet").read_bytes()
    first.write_bytes(data)
    with opened(whole, short, resume=True, records=None) as own:
        assert own.done() == [(0, 8)]
        own.finish()
    assert (whole / "results.parquet").read_bytes() == table
    assert names(whole) == {"campaign.json", "manifest.json", "results.parquet", "wall.parquet"}
    assert parquet.read_table(whole / "results.parquet")["number"].to_pylist() == list(range(8))


def test_cut_off_before_the_manifest(short: Campaign, tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    (tmp_path / "campaign.json").write_text("{")
    (tmp_path / ".manifest.json.9.tmp").touch()
    with opened(tmp_path, short, resume=True, records=None) as own:
        assert own.done() == []
    assert names(tmp_path) == {".lock", "campaign.json", "manifest.json"}


CHANGES: list[tuple[dict[str, Any], str]] = [
    (
        {"seed": 6},
        "campaign.toml: seed: changed since the campaign began: got 6; expected 5, or a new folder",
    ),
    ({"trials": 9}, "trials: changed since the campaign began: got 9; expected 8"),
    ({"factors": {"e_agents": [0, 3], "duration": [1.0, 2.0]}}, "factors.e_agents[1]: changed"),
    ({"factors": {"e_agents": [0, 2]}}, "factors.duration: changed"),
    ({"configurations": [{"name": "demo", "file": "town"}]}, "configurations[0].document."),
    ({"controllers": ["simple"]}, "controllers: changed since the campaign began: got ['simple']"),
]


@pytest.mark.parametrize(("change", "message"), CHANGES, ids=[message[:30] for _, message in CHANGES])
def test_a_changed_campaign_is_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    out = tmp_path / "out"
    with opened(out, load_campaign(written(tmp_path, campaign())), resume=False, records="failures"):
        pass
    other = load_campaign(written(tmp_path, campaign(**change)))
    with pytest.raises(InputError) as caught, opened(out, other, resume=True, records=None):
        pass
    assert message in str(caught.value)


def test_changed_surroundings_are_refused(tmp_path: Path) -> None:
    file, out = written(tmp_path, campaign()), tmp_path / "out"
    own = load_campaign(file)
    with opened(out, own, resume=False, records="failures"):
        pass
    with (
        pytest.raises(InputError, match=r"records: changed .*got 'all'; expected \"failures\""),
        opened(out, own, resume=True, records="all"),
    ):
        pass
    with (
        pytest.raises(InputError, match="holds a campaign; expected a new folder"),
        opened(out, own, resume=False, records=None),
    ):
        pass
    (tmp_path / "controllers.py").write_text("class Logged:\n    start = act = print\n")
    with (
        pytest.raises(InputError, match=r"controllers\[0\] \(.*controllers.py:Logged\): changed"),
        opened(out, own, resume=True, records=None),
    ):
        pass
    written(tmp_path, campaign())
    place = out / "manifest.json"
    document = json.loads(place.read_text())
    document["versions"]["dubins-traffic"] = "0.0.1"
    place.write_text(json.dumps(document))
    with (
        pytest.raises(InputError, match=r"versions.dubins-traffic: changed .*expected \"0.0.1\""),
        opened(out, own, resume=True, records=None),
    ):
        pass


def test_a_folder_that_is_something_else(short: Campaign, tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    with (
        pytest.raises(InputError, match=r"holds thesis.tex and is no campaign's folder"),
        opened(tmp_path, short, resume=True, records=None),
    ):
        pass
    with (
        pytest.raises(InputError, match=r"can't hold a campaign \(Not a directory\)"),
        opened(tmp_path / "thesis.tex" / "out", short, resume=False, records=None),
    ):
        pass


def test_which_records_are_kept(tmp_path: Path, short: Campaign) -> None:
    assert read_keep("sample:5") == (Keep.SAMPLE, 5)
    for wrong in ("some", "sample", "sample:0", "all:3", ""):
        with pytest.raises(InputError, match="expected none, all, failures or sample:N"):
            read_keep(wrong)
    sample = Records(tmp_path, Keep.SAMPLE, 5, 103)
    assert sum(sample.path(n) is not None for n in range(103)) == 5
    chunk = next(short.chunks())
    with pytest.raises(DubinsTrafficError, match="records need a folder that all machines share"):
        run_chunk(chunk, sample)
    (tmp_path / "records").mkdir()
    run_chunk(chunk, Records(tmp_path, Keep.ALL, 0, 8))
    run_chunk(chunk.part(1, 2), Records(tmp_path, Keep.FAILURES, 0, 8))
    kept = {path.name for path in (tmp_path / "records").glob("*.mcap")}
    assert kept == {"trial-000000000.mcap", "trial-000000002.mcap"}


def test_results_are_typed(short: Campaign, tmp_path: Path) -> None:
    with opened(tmp_path, short, resume=False, records=None) as own:
        fill(own)
        own.finish()
    schema = parquet.read_schema(tmp_path / "results.parquet")
    types = {name: str(schema.field(name).type) for name in schema.names}
    assert types["factor.e_agents"] == types["number"] == "int64"
    assert types["factor.duration"] == types["min_clearance_m"] == "double"
    assert types["seed"] == "uint64"
    assert types["clean"] == "bool"
    assert not [name for name in schema.names if name.endswith("_s") and "act" in name]
    assert "time_to_begin_s" in parquet.read_schema(tmp_path / "wall.parquet").names


def test_a_machine_without_the_controller_makes_no_rows(short: Campaign) -> None:
    chunk = replace(next(short.chunks()), controller="/nowhere/mine.py:Mine")
    with pytest.raises(InputError, match=r"no such file: /nowhere/mine.py"):
        run_chunk(chunk)


DAMAGE: dict[str, tuple[str, dict[str, Any], str]] = {
    "a text for an entry": (manifest.NAME, {"controllers": ["lanes"]}, r"controllers\[0\]: wrong value"),
    "no controllers": (manifest.NAME, {"controllers": []}, "controllers: "),
    "no versions": (manifest.NAME, {"versions": [1]}, "versions: wrong value"),
    "not our version": (manifest.NAME, {"versions": {}}, "versions.dubins-traffic: missing"),
    "another campaign": (manifest.CAMPAIGN, {"seed": 77}, "campaign.json: changed since the campaign began"),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_what_is_told_of_a_campaign_is_as_it_was_written(kind: str, short: Campaign, tmp_path: Path) -> None:
    with opened(tmp_path / "out", short, resume=False, records=None):
        pass
    name, change, needle = DAMAGE[kind]
    path = tmp_path / "out" / name
    path.write_text(json.dumps({**json.loads(path.read_text()), **change}))
    with pytest.raises(InputError, match=needle):
        manifest.stored_campaign(tmp_path / "out", manifest.read(tmp_path / "out") or {})


def test_a_controller_that_is_missing_in_the_manifest(short: Campaign, tmp_path: Path) -> None:
    with opened(tmp_path / "out", short, resume=False, records=None):
        pass
    known = manifest.read(tmp_path / "out") or {}
    twice = {**known, "controllers": [*known["controllers"], *known["controllers"]]}
    with pytest.raises(InputError, match="controllers: other controllers"):
        manifest.stored_campaign(tmp_path / "out", twice)


def test_versions_are_those_of_the_libraries_that_are_installed(monkeypatch) -> None:
    monkeypatch.setattr(manifest, "LIBRARIES", ("numpy", "no-such-library"))
    assert manifest._versions() == {"numpy": np.__version__}
