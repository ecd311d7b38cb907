import json
from pathlib import Path

import pytest

from dubins_traffic.roads.network import RoadNetwork

DATA = Path(__file__).parent / "data"


def _networks() -> dict[str, RoadNetwork]:
    instance = json.loads((DATA / "instance-3x4.json").read_text())
    trials = json.loads((DATA / "mc-small-4grid-agents2.json").read_text())
    return {
        "square.json": RoadNetwork.read(DATA / "square.json"),
        "square.rnd": RoadNetwork.read(DATA / "square.rnd"),
        "instance-3x4.json": RoadNetwork.from_document(instance["rnd"]),
        "mc-small-4grid-agents2.json": RoadNetwork.from_document(trials["rnd"]),
    }


def test_both_containers_hold_the_same_square() -> None:
    networks = _networks()
    assert networks["square.json"] == networks["square.rnd"]
    assert networks["square.json"].length == 5
    assert networks["square.json"].shape == (2, 2)


@pytest.mark.parametrize("name", sorted(_networks()))
def test_what_2016_wrote_reads_and_writes_back_to_the_same_value(name: str, tmp_path: Path) -> None:
    network = _networks()[name]
    for suffix in (".json", ".rnd"):
        network.write(tmp_path / f"a{suffix}")
        assert RoadNetwork.read(tmp_path / f"a{suffix}") == network
    document = json.loads((tmp_path / "a.json").read_text())
    source = json.loads((DATA / name).read_text()) if name.endswith(".json") else document
    source = source.get("rnd", source)
    assert {key: document[key] for key in source} == source


def test_the_grid_has_the_segments_of_2016() -> None:
    instance = json.loads((DATA / "instance-3x4.json").read_text())
    grid = RoadNetwork.grid(3, 4)
    assert set(grid.segments) == {tuple(segment) for segment in instance["rnd"]["segments"]}
    assert grid.segments[:4] == ((0, 0, 1, 0), (0, 0, 0, 1), (0, 1, 1, 1), (0, 1, 0, 2))
    assert grid.segments[-5:] == ((0, 2, 1, 2), (1, 2, 2, 2), (2, 2, 3, 2), (3, 0, 3, 1), (3, 1, 3, 2))
    assert grid == _networks()["mc-small-4grid-agents2.json"]
