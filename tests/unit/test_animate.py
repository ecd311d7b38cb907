"""Moving pictures: what they show, how long they last, how large they are, and that nothing half-written is left."""

from __future__ import annotations

import base64
import importlib
import re
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from time import process_time
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from PIL import Image as Pictures

import dubins_traffic as dt
from dubins_traffic.animation import animate as moving
from dubins_traffic.animation.indexed import Colours, changes
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError, MissingExtraError
from dubins_traffic.record.sink import End, Ending
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial
from tests.recordings import make_instance
from tests.synthetic import driven, instance, verdict
from tests.tools import need

GRID = RoadNetwork.grid(3, 4)


@pytest.fixture(scope="module")
def record() -> dt.Record:
    tried, frames = driven(instance(GRID, 6, 60.0))
    return dt.Record(tried, frames, (frames,), Ending(End.DURATION, len(frames) - 1), "none", {})


def durations(picture: Any) -> list[float]:
    found: list[float] = []
    for number in range(picture.n_frames):
        picture.seek(number)
        found.append(picture.info["duration"])
    return found


@pytest.mark.parametrize("suffix", [".gif", ".png"])
def test_a_file_shows_what_is_painted_for_as_long_as_it_lasts(record: dt.Record, tmp_path: Path, suffix: str) -> None:
    found = dt.animate(record, start=2.0, stop=8.0, speed=2.0, fps=8.0, size=300)
    assert len(found) == 25
    assert repr(found) == f"<Animation: 25 pictures of {found_size(found)} pixels, 8 a second>"
    found.write(tmp_path / f"x{suffix}")
    found.write(tmp_path / f"y{suffix}")
    assert (tmp_path / f"x{suffix}").read_bytes() == (tmp_path / f"y{suffix}").read_bytes()
    with Pictures.open(tmp_path / f"x{suffix}") as file:
        assert file.info.get("loop") == 0
        assert abs(sum(durations(file)) - 25 / 8.0 * 1000.0) < 25.0
    painted = list(found)
    with Pictures.open(tmp_path / f"x{suffix}") as file:
        assert file.n_frames == len(painted)
        for number in (0, 7, 24):
            file.seek(number)
            seen = np.asarray(file.convert("RGB")).astype(int)
            apart = np.abs(seen - painted[number].astype(int))
            assert apart.mean() < 0.5
            assert np.quantile(apart, 0.999) < 40.0


def found_size(found: dt.Animation) -> str:
    height, width = next(iter(found)).shape[:2]
    return f"{width} x {height}"


def test_the_first_and_the_last_second_are_shown_and_the_longer_side_is_as_asked(record: dt.Record) -> None:
    whole = list(dt.animate(record, fps=0.5, size=200))
    assert len(whole) == 31
    assert max(whole[0].shape) == 200
    assert all(side % 2 == 0 for side in whole[0].shape[:2])
    last = list(dt.animate(record, start=60.0, size=200))
    assert len(last) == 1
    assert (last[0] == whole[-1]).all()
    assert (whole[0] != whole[-1]).any()


def test_breaches_are_marked_when_they_come_and_the_pictures_before_are_as_without(record: dt.Record) -> None:
    judged = verdict(record.instance, [(3.0, "ego", "2.left")], 0)
    bare, marked = (list(dt.animate(record, start=2.0, stop=5.0, fps=2.0, verdict=one)) for one in (None, judged))
    assert [bool((one != other).any()) for one, other in zip(bare, marked, strict=True)] == [
        False, False, True, True, True, True, True,
    ]  # fmt: skip


def test_goals_are_lit_as_in_the_replay_page() -> None:
    tried = instance(GRID, 1, 1.0)
    goals = list(dict.fromkeys(tried.problem.goal_vertices))
    assert len(goals) >= 2
    visits = [(10 * k, goal) for k, goal in enumerate([*goals, goals[0]])]
    lit = moving._Lit(tried.problem, visits)
    assert lit.at(0, goals[0]) == [goals[0]]
    assert lit.at(5, -1) == [goals[0]]
    assert lit.at(10 * len(goals) - 10, goals[-1]) == [goals[-1]]
    assert lit.at(10 * len(goals) - 5, -1) == []
    assert lit.at(10 * len(goals), goals[0]) == [goals[0]]


def test_a_gif_of_a_minute_is_small_and_stores_changes_alone(record: dt.Record, tmp_path: Path) -> None:
    found = dt.animate(record)
    assert len(found) == 601
    found.write(tmp_path / "x.gif")
    assert (tmp_path / "x.gif").stat().st_size < 2_000_000
    images = list(found)[:40]
    colours = Colours(images[:1])
    parts = list(changes(iter(images), colours))
    assert len(parts) == 40
    canvas = parts[0].pixels.copy()
    for part, image in zip(parts[1:], images[1:], strict=True):
        high, wide = part.pixels.shape
        place = canvas[part.top : part.top + high, part.left : part.left + wide]
        place[...] = np.where(part.pixels == 255, place, part.pixels)
        assert (canvas == colours.numbers(image)).all()


def test_a_gif_takes_at_most_twice_what_pillow_takes_for_the_same_pictures(record: dt.Record, tmp_path: Path) -> None:
    found = dt.animate(record, stop=8.0)
    images = [Pictures.fromarray(image) for image in found]
    begun = process_time()
    images[0].save(tmp_path / "pillow.gif", save_all=True, append_images=images[1:], duration=100, loop=0)
    theirs = process_time() - begun
    begun = process_time()
    found.write(tmp_path / "ours.gif")
    assert process_time() - begun < 2.0 * theirs


def test_a_picture_that_changes_nothing_makes_the_one_before_last_longer(tmp_path: Path) -> None:
    tried, frames = driven(instance(GRID, 2, 4.0))
    for name in ("x", "y", "c", "s", "at"):
        column = getattr(frames, name)
        column.flags.writeable = True
        column[30:91] = column[30]
    still = dt.Record(tried, frames, (frames,), None, "none", {})
    for suffix in (".gif", ".png"):
        dt.animate(still, fps=10.0).write(tmp_path / f"x{suffix}")
        with Pictures.open(tmp_path / f"x{suffix}") as file:
            found = durations(file)
        assert max(found) > 1900.0
        assert abs(sum(found) - 4100.0) < 1.0


def test_notebooks_play_it_without_a_script(record: dt.Record) -> None:
    text = dt.animate(record, stop=1.0, size=120)._repr_html_()
    found = re.fullmatch(r'<img alt="[^"]+" style="[^"]+" src="data:image/png;base64,([^"]+)">', text)
    assert found is not None
    with Pictures.open(BytesIO(base64.b64decode(found[1]))) as file:
        assert file.n_frames == 11


BAD = {
    "fps": ({"fps": 0.0}, r"--fps: out of range: got 0.0; expected 0.1 to 120"),
    "speed": ({"speed": -1.0}, r"--speed: out of range"),
    "not a number": ({"speed": float("nan")}, r"--speed: out of range"),
    "size": ({"size": 5}, r"--size: out of range: got 5; expected 16 to 4096"),
    "start": (
        {"start": -1.0},
        r"--from: outside the trial: got -1.0; expected a second of the trial, 0 to 60",
    ),
    "stop": ({"stop": 61.0}, r"--to: outside the trial"),
    "order": ({"start": 5.0, "stop": 3.0}, r"--to: before --from"),
    "many": ({"speed": 0.01, "fps": 100.0}, r"too many pictures: got 600001"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_out_of_range_is_refused(record: dt.Record, name: str) -> None:
    given, told = BAD[name]
    with pytest.raises(InputError, match=told):
        dt.animate(record, **given)  # pyright: ignore[reportArgumentType]


def test_a_record_without_frames_and_too_quick_a_gif_are_refused(record: dt.Record, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--fps: too many pictures a second: got 60\.0; expected at most 50"):
        dt.animate(record, fps=60.0).write(tmp_path / "x.gif")
    assert list(tmp_path.iterdir()) == []


def test_what_is_interrupted_leaves_nothing(record: dt.Record, tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        if done == 5 < total:
            raise KeyboardInterrupt

    (tmp_path / "x.gif").write_bytes(b"older")
    for suffix in (".gif", ".png"):
        with pytest.raises(KeyboardInterrupt):
            dt.animate(record, size=100).write(tmp_path / f"x{suffix}", overwrite=True, progress=stop)
    assert [(path.name, path.read_bytes()) for path in tmp_path.iterdir()] == [("x.gif", b"older")]


@pytest.mark.parametrize(("suffix", "library"), [(".gif", "PIL"), (".mp4", "av"), (".webm", "av")])
def test_a_missing_library_is_named(
    record: dt.Record, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, library: str
) -> None:
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(MissingExtraError, match=r"install dubins-traffic\[video\]"):
        dt.animate(record).write(tmp_path / f"x{suffix}")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("moving") / "t.mcap"
    run_trial(make_instance(ticks=60), "simple", record=path)
    return path


def test_the_command_takes_options_for_moving_pictures(
    recorded: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "x.png"
    words = ["replay", str(recorded), "-o", str(target), "--fps", "5", "--speed", "0.5", "--from", "0.5"]
    assert main([*words, "--to", "1.5", "--size", "90"]) == 0
    assert capsys.readouterr().err == f"{target}\n"
    with Pictures.open(target) as file:
        assert max(file.size) == 90
        assert abs(sum(durations(file)) - 2200.0) < 1.0
    assert main([*words, "--to", "99", "--overwrite"]) == 2
    assert "--to: outside the trial" in capsys.readouterr().err
    assert main(["replay", str(recorded), "-o", str(tmp_path / "x.html"), "--speed", "2"]) == 2
    assert "--speed: of a moving picture" in capsys.readouterr().err
    assert main(["replay", str(recorded), "-o", str(tmp_path / "x.gif"), "--at", "2"]) == 2
    assert "--at: of a page" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["x.png"]


def video_library() -> ModuleType:
    """PyAV, which the extra `video` brings."""
    try:
        return importlib.import_module("av")
    except ImportError:
        need("PyAV", "the extra `video` brings it")
        raise


@pytest.mark.tools
@pytest.mark.parametrize("suffix", [".mp4", ".webm"])
def test_a_video_shows_what_is_painted(record: dt.Record, tmp_path: Path, suffix: str) -> None:
    av = video_library()
    found = dt.animate(record, fps=30.0)
    found.write(tmp_path / f"x{suffix}")
    assert (tmp_path / f"x{suffix}").stat().st_size < 1_000_000
    painted: Iterator[Any] = iter(found)
    with av.open(str(tmp_path / f"x{suffix}")) as file:
        assert file.duration == pytest.approx(60.03 * 1e6, abs=0.1e6)
        count = 0
        for image, seen in zip(painted, file.decode(video=0), strict=True):
            count += 1
            if count % 300 == 1:
                apart = np.abs(seen.to_ndarray(format="rgb24").astype(int) - image.astype(int))
                assert apart.mean() < 6.0
    assert count == 1801
