"""Maps that gzip has packed, and configurations that name maps of other programs."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import pytest

from dubins_traffic import files
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.maps.losses import Losses
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.record import reader
from dubins_traffic.roads.formats import registry
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.sources import load
from tests.foreign_maps import FOREIGN, written

GRID = RoadNetwork.grid(2, 3)


@pytest.mark.parametrize("name", [*FOREIGN, "rnd-json", "rnd-text"])
def test_what_is_packed_is_read_and_written(name: str, tmp_path: Path) -> None:
    file = tmp_path / f"town{registry.load(name).suffixes[0]}.gz"
    file.write_bytes(gzip.compress(written(name).encode()))
    assert RoadNetwork.read(file).segments == GRID.segments
    found = load(file)
    assert isinstance(found, RoadNetwork)
    assert found.segments == GRID.segments
    again = tmp_path / f"again{registry.load(name).suffixes[0]}.gz"
    assert main(["convert", str(file), "-o", str(again)]) == 0
    assert gzip.decompress(again.read_bytes()).decode() == written(name)
    first = again.read_bytes()
    GRID.write(again, overwrite=True)
    assert again.read_bytes() == first


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Files of gzip may stand one after another: 17 times 16 MiB of blanks."""
    file = tmp_path / "town.net.xml.gz"
    file.write_bytes(gzip.compress(b" " * (1 << 24)) * 17)
    assert file.stat().st_size < 1 << 20
    assert main(["convert", str(file), "-o", str(tmp_path / "a.json")]) == 2
    told = capsys.readouterr().err
    assert "town.net.xml.gz: unpacks to too much" in told
    assert "256 MiB" in told
    assert not (tmp_path / "a.json").exists()


def test_the_limit_is_that_of_files(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "MOST_BYTES", 100)
    assert files.unpacked(gzip.compress(bytes(100)), "a") == bytes(100)
    with pytest.raises(InputError, match="unpacks to too much"):
        files.unpacked(gzip.compress(bytes(101)), "a")


@pytest.mark.parametrize("kind", ["truncated", "changed", "head", "other text"])
def test_what_is_damaged_is_refused(kind: str, tmp_path: Path) -> None:
    whole = gzip.compress(written("sumo").encode())
    middle = len(whole) // 2
    data = {
        "truncated": whole[:middle],
        "changed": whole[:middle] + bytes(40) + whole[middle + 40 :],
        "head": whole[:2] + b"\xff" + whole[3:],
        "other text": gzip.compress(b"\xff\xfe\x00"),
    }[kind]
    file = tmp_path / "town.net.xml.gz"
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"not what gzip packs|not UTF-8") as caught:
        RoadNetwork.read(file)
    assert caught.value.file == str(file)


@pytest.mark.parametrize("name", [*FOREIGN, "sumo packed"])
def test_a_configuration_may_name_any_of_them(name: str, tmp_path: Path) -> None:
    packed = name.endswith("packed")
    form = name.removesuffix(" packed")
    file = tmp_path / f"town{registry.load(form).suffixes[0]}{'.gz' if packed else ''}"
    GRID.write(file)
    document = {**load_config("demo").document, "rnd": file.name}
    (tmp_path / "own.json").write_text(json.dumps(document))
    own = load_config(tmp_path / "own.json")
    assert own.network is not None
    assert own.network.segments == GRID.segments
    assert isinstance(own.network.known[registry.LOSSES], Losses)


def test_run_drives_on_a_map_of_sumo_and_tells_what_was_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "town.net.xml.gz").write_bytes(gzip.compress(written("sumo").encode()))
    document = {**load_config("demo").document, "rnd": "town.net.xml.gz", "duration_bounds": [4, 4]}
    (tmp_path / "own.json").write_text(json.dumps(document))
    command = ["run", str(tmp_path / "own.json"), "--trials", "1", "--records", str(tmp_path / "out")]
    assert main(command) == 0
    assert "7 segments of 7 roads" in capsys.readouterr().err
    assert reader.read(tmp_path / "out" / "trial-0000.mcap").instance.problem.network.segments == GRID.segments
