import os
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from shapely.affinity import rotate, translate
from shapely.geometry import LineString, Point, Polygon, box
from shapely.ops import unary_union

from dubins_traffic.cars.body import Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.errors import InputError
from dubins_traffic.gazebo import install, prefix
from dubins_traffic.gazebo.world import (
    MARKER,
    TRACK,
    WALL,
    WHEEL_RADIUS,
    Drive,
    Version,
    to_sdf,
    walls,
    world,
)
from dubins_traffic.roads.generate import generate
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.simulators import registry
from tests.batches import pose
from tests.recordings import make_instance

CORNERS = ((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 0.3), (0.0, 1.0))


@pytest.mark.parametrize("corners", [CORNERS, CORNERS[::-1]])
def test_walls_stand_within_their_polygon(corners: tuple[tuple[float, float], ...]) -> None:
    whole = Polygon(corners)
    found = walls(PolygonObstacle(corners))
    assert len(found) == len(corners)
    covered = Polygon()
    for x, y, yaw, length in found:
        wall = box(-0.5 * length, -0.5 * WALL, 0.5 * length, 0.5 * WALL)
        wall = translate(rotate(wall, yaw, (0, 0), use_radians=True), x, y)
        assert wall.difference(whole).area <= WALL * WALL
        covered = covered.union(wall.buffer(1e-9))
    assert covered.covers(whole.exterior)


def test_wheels_turn_as_the_car_is_asked_to() -> None:
    drive = Drive.below(Disc())
    assert drive.track == TRACK
    left, right = drive.wheels(np.array([0.5, 0.0]), np.array([0.0, 0.9]))
    assert left[0] == right[0] == 0.5 / WHEEL_RADIUS
    assert (right[1] - left[1]) * WHEEL_RADIUS / drive.track == pytest.approx(0.9)
    assert Drive.below(Rectangle(0.5, 0.2)).track < 0.2


def test_a_world_holds_every_body() -> None:
    obstacles = (DiscObstacle(3, 0, 0.5), PolygonObstacle(CORNERS))
    text = world([pose(0, 0), pose(5, 5, 1.0)], Disc(), obstacles, 0.005, "plugin<&>.so")
    root = ElementTree.fromstring(text)
    models = [model.get("name") for model in root.iter("model")]
    assert models == ["ground", "obstacle_0", "obstacle_1", "ego", "car_1"]
    (plugin,) = root.iter("plugin")
    assert plugin.get("filename") == "plugin<&>.so"
    assert [each.text for each in plugin.iter("car")] == ["ego", "car_1"]
    assert len(plugin.findall("obstacle")) == 2


@pytest.mark.parametrize("version", list(Version))
def test_roads_are_those_of_2016(version: Version) -> None:
    network = RoadNetwork.grid(2, 2, length=3.0)
    root = ElementTree.fromstring(to_sdf(network, version))
    assert root.get("version") == version.value
    sizes = [[float(part) for part in (size.text or "").split()] for size in root.iter("size")]
    assert sum(size[:2] == [4.2, 1.2] for size in sizes) == 4
    assert sum(size[:2] == [3.0, MARKER] for size in sizes) == 4


def _boxes(root: ElementTree.Element, name: str) -> list[Polygon]:
    """Return the boxes of roads that are called so, in the plane."""
    found: list[Polygon] = []
    for model in root.iter("model"):
        own = next((each for each in model.iter("visual") if each.get("name") == name), None)
        if own is not None:
            x, y, _, _, _, yaw = (float(part) for part in (model.findtext("pose") or "").split())
            aside = float((own.findtext("pose") or "").split()[0])
            long, wide, _ = (float(part) for part in (own.findtext("geometry/box/size") or "").split())
            shape = box(aside - 0.5 * long, -0.5 * wide, aside + 0.5 * long, 0.5 * wide)
            found.append(translate(rotate(shape, yaw, (0, 0), use_radians=True), x, y))
    return found


def test_roads_that_bend_are_paved_evenly() -> None:
    network = generate(9, 12, 4, bent=1.0)
    root = ElementTree.fromstring(to_sdf(network))
    surface = unary_union(_boxes(root, "surface"))
    lines = [LineString(network.lane_curve(2 * s, 0.0)) for s in range(len(network.segments))]
    assert surface.buffer(1e-6).contains(unary_union([line.buffer(0.58) for line in lines]))
    # Corners of the boxes reach 0.25 m beyond round ends.
    assert (
        unary_union([line.buffer(0.62) for line in lines])
        .union(unary_union([Point(*place).buffer(0.86) for place in network.points]))
        .contains(surface)
    )
    assert len(_boxes(root, "marker")) > 3 * len(network.segments)


def test_an_instance_is_shown_with_its_bodies() -> None:
    instance = make_instance(obstacles=[DiscObstacle(3, 3, 0.5)])
    root = ElementTree.fromstring(to_sdf(instance))
    names = [model.get("name") for model in root.iter("model")]
    assert names == ["ground", *(f"road_{k}" for k in range(17)), "obstacle_0", "ego", "car_1", "car_2"]


def test_what_is_not_installed_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"not installed.*gazebo install --prefix"):
        prefix.find(tmp_path / "nothing")
    monkeypatch.setenv(prefix.VARIABLE, str(tmp_path / "elsewhere"))
    with pytest.raises(InputError, match=r"elsewhere.*not installed"):
        registry.load("gazebo")
    (tmp_path / "elsewhere").mkdir()
    prefix.write_manifest(tmp_path / "elsewhere", tmp_path / "gzserver", own=False, version="11")
    with pytest.raises(InputError, match="gzserver has gone"):
        registry.load("gazebo")


def test_only_gazebo_has_a_window() -> None:
    with pytest.raises(InputError, match="shows nothing"):
        registry.load("embedded", show=True)


def test_a_machine_without_apt_is_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "bash").symlink_to(str(shutil.which("bash")))
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(InputError, match=r"no apt-get; expected Debian .* gzserver") as error:
        install.fetch_packages(tmp_path / "prefix", print)
    assert error.value.file == str(tmp_path / "prefix")


def test_what_a_program_of_apt_says_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An apt that knows a mirror which has no such suite: it is tried, named, and nothing is unpacked."""
    said: list[tuple[str, float]] = []
    (tmp_path / "bin").mkdir()
    apt = tmp_path / "bin" / "apt-get"
    apt.write_text(
        '#!/bin/sh\ncase "$*" in *print-uris*) echo "\'http://mirror.example/debian/dists/x/InRelease\' a 0" ;;\n'
        "*) echo 'E: no such release' >&2; exit 100 ;; esac\n"
    )
    (tmp_path / "bin" / "dpkg-deb").write_text("#!/bin/sh\nexit 1\n")
    for path in (tmp_path / "bin").iterdir():
        path.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path / 'bin'}:{os.environ['PATH']}")
    with pytest.raises(InputError, match=r"gives bullseye \(E: no such release\)"):
        install.fetch_packages(tmp_path / "prefix", lambda *told: said.append(told))
    assert said == [("list of packages", 0.0)]
    sources = (tmp_path / "prefix" / "apt" / "sources.list").read_text()
    assert "http://mirror.example/debian bullseye main" in sources
    assert list((tmp_path / "prefix" / "root").iterdir()) == []
