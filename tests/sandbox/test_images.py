"""Container images in boxes: they drive as programs do, alone in a box, and get out as little."""

from __future__ import annotations

import gzip
import os
import shutil
import tarfile
from pathlib import Path

import platformdirs
import pytest

import dubins_traffic as dt
from dubins_traffic.competition.judging import FramesHash
from dubins_traffic.competition.submission import check_submission
from dubins_traffic.errors import InputError
from dubins_traffic.sandbox import BoxedController, Layers, boxed_controller, images
from dubins_traffic.service.worker import lacks_room
from tests import images as made
from tests.boxes import needs_boxes
from tests.disks import fill, small_disk
from tests.recordings import make_instance
from tests.sandbox.test_attacks import USER, as_root, as_user, open_folder

pytestmark = needs_boxes


@pytest.fixture(autouse=True)
def _store(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(platformdirs, "user_cache_dir", lambda _name: str(tmp_path / "cache"))


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    made.require()
    return made.program(tmp_path)


def submission(folder: Path, source: Path, *changes: str, program: str = "") -> Path:
    """Make a submission of an image of the files in an archive."""
    place = folder / "submission"
    place.mkdir(exist_ok=True)
    made.image(folder, source, *changes).rename(place / "image.tar")
    (place / "controller.toml").write_text(f'image = "image.tar"\n{program}')
    return place


def hashed(spec: str | Path) -> tuple[str | None, BoxedController]:
    """Drive a trial; return the hash of its frames."""
    controller, digest = boxed_controller(str(spec)), FramesHash()
    dt.run_trial(make_instance(names=("agent0",), ticks=30), controller, sinks=(digest,))
    return digest.result(), controller


def test_an_image_drives_as_its_program_does(tmp_path: Path, drive: Path) -> None:
    source = made.layer(tmp_path, files={"drive": drive.read_bytes()})
    place = submission(tmp_path, source, 'CMD ["/drive"]', "ENV TURN=0.1", "ENV LD_PRELOAD=/drive")
    plain, _ = hashed(f"program:{drive}")
    assert hashed(place)[0] == plain
    (place / "controller.toml").write_text('image = "image.tar"\nprogram = ["./drive", "0.7"]\n')
    turned, controller = hashed(place)
    assert turned not in (plain, None)
    assert controller.end is None
    found = check_submission(place, tmp_path / "kept")
    assert found.kind == "image"
    assert hashed(found.path)[0] == turned


def test_it_sees_itself_and_has_the_limits_of_every_box(tmp_path: Path, drive: Path) -> None:
    device = tarfile.TarInfo("dev/kmsg")
    device.type, device.devmajor, device.devminor, device.mode = tarfile.CHRTYPE, 1, 11, 0o666
    link = tarfile.TarInfo("proc")
    link.type, link.linkname = tarfile.SYMTYPE, "/tmp"
    files = {"drive": drive.read_bytes(), "etc/ld.so.preload": b"/drive\n"}
    place = submission(
        tmp_path, made.layer(tmp_path, link, device, files=files), program='program = ["/drive", "look"]'
    )
    _, controller = hashed(place)
    assert controller.end is None
    assert controller.log_tail.split("\n")[:3] == ["reads /dev/null", "writes /tmp/new", "opens 256 as 1000"]


def test_what_is_no_image_is_refused(tmp_path: Path, drive: Path) -> None:
    place = submission(tmp_path, made.layer(tmp_path, files={"drive": drive.read_bytes()}))
    image = place / "image.tar"
    good = image.read_bytes()
    for data, why in (
        (b"nothing", "no image"),
        (good[:5000], "no image|podman load"),
        (gzip.compress(good, 1), "no image"),
        (made.layer(tmp_path, files={"layer.tar": b"BZh91AY&SY"}).read_bytes(), "unusual way"),
        (made.layer(tmp_path, files={"a": b""}).read_bytes(), "podman load"),
        (good, "runs nothing"),
    ):
        image.write_bytes(data)
        with pytest.raises(InputError, match=why):
            boxed_controller(str(place))
    image.write_bytes(good)
    (place / "controller.toml").write_text('image = "image.tar"\nprogram = ["/drive"]\n')
    assert hashed(place)[0] == hashed(f"program:{drive}")[0]
    assert [own.name for own in (tmp_path / "cache" / "images").iterdir() if own.name.startswith(".")] == []


def test_a_bomb_is_refused_before_podman_sees_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "MOST", 1 << 20)
    monkeypatch.setattr(images, "why_not", lambda: "")
    bomb = made.layer(tmp_path, files={"layer.tar": gzip.compress(bytes(2 << 20))})
    with pytest.raises(InputError, match="unpacks to too much"):
        images.unpacked(bomb)


@as_root
def test_an_ordinary_user_unpacks_an_image(tmp_path: Path, drive: Path) -> None:
    place = submission(tmp_path, made.layer(tmp_path, files={"drive": drive.read_bytes()}), 'CMD ["/drive"]')
    with open_folder() as folder:
        shutil.copy(place / "image.tar", folder / "image.tar")
        (folder / "store").mkdir()
        os.chown(folder / "store", USER, USER)
        unpack = "import sys; from pathlib import Path; from dubins_traffic.sandbox import images; "
        unpack += "print(images.unpacked(Path(sys.argv[1]), Path(sys.argv[2])).command)"
        done = as_user(USER, ["-c", unpack, str(folder / "image.tar"), str(folder / "store")])
    assert done.stdout == "('/drive',)\n", done.stderr


def test_a_full_disk_is_this_machine_s_fault(tmp_path: Path, drive: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = submission(tmp_path, made.layer(tmp_path, files={"drive": drive.read_bytes()}), 'CMD ["/drive"]')
    with small_disk(tmp_path / "disk", 1 << 10) as disk:
        monkeypatch.setattr(platformdirs, "user_cache_dir", lambda _name: str(disk))
        fill(disk / "ballast", 200_000)
        with pytest.raises(InputError, match="can't be unpacked") as found:
            boxed_controller(str(place))
        assert lacks_room(found.value)


def test_links_out_of_an_image_are_refused(tmp_path: Path) -> None:
    for kind, name, target in (
        (tarfile.LNKTYPE, "a", "../../../../etc/passwd"),
        (tarfile.REGTYPE, "../out", ""),
    ):
        entry = tarfile.TarInfo(name)
        entry.type, entry.linkname = kind, target
        with pytest.raises((InputError, tarfile.TarError)):
            images._kept(entry, str(tmp_path))


def test_without_podman_or_a_box_an_image_is_refused(
    tmp_path: Path, drive: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = submission(tmp_path, made.layer(tmp_path, files={"drive": drive.read_bytes()}), 'CMD ["/drive"]')
    with monkeypatch.context() as there:
        there.setenv("PATH", str(tmp_path))
        with pytest.raises(InputError, match="can't be run here: podman is not installed"):
            boxed_controller(str(place))
    assert images.why_not() == ""
    bare = Layers(why="a test").without("files", "network", "pids", "ipc", "users")
    with pytest.raises(InputError, match="in a box alone"):
        boxed_controller(str(place), trust=True, layers=bare)
    assert os.path.lexists(place)
