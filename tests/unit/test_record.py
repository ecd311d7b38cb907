import contextlib
import json
import multiprocessing
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.writer import CompressionType, Writer

from dubins_traffic.cars.state import Frames
from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record import wall
from dubins_traffic.record.reader import from_bytes, read, replay
from dubins_traffic.record.writer import RecordWriter
from tests.recordings import REALS, WHOLE, blocks, feed, make_instance, random_frames, same

INSTANCE = make_instance(ticks=75)
FRAMES = random_frames(INSTANCE, seed=1, count=76)
WHOLE_FILE = Path(__file__).parents[1] / "golden" / "data" / "record-1.mcap"


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "a.mcap"
    feed(INSTANCE, FRAMES, RecordWriter(path, controller="some/folder/mine.py:Mine"))
    return path


class Listener:
    def __init__(self) -> None:
        self.instances, self.blocks, self.endings = [], [], []

    def begin(self, instance) -> None:
        self.instances.append(instance)

    def frames(self, frames) -> None:
        self.blocks.append(frames)

    def end(self, ending) -> None:
        self.endings.append(ending)


def test_what_is_written_is_read(path: Path) -> None:
    record = read(path)
    assert record.instance == INSTANCE
    assert same(record.frames, FRAMES)
    assert record.ending == Ending(End.DURATION, 75)
    assert record.controller == "mine.py:Mine"
    assert set(record.versions) == {"dubins-traffic", "mcap"}
    assert record.wall is None
    assert record.file == str(path)


def test_an_ending_keeps_its_detail(tmp_path: Path) -> None:
    ending = Ending(End.CONTROLLER_FAULT, 75, "ValueError: ä\nnext line")
    feed(INSTANCE, FRAMES, RecordWriter(tmp_path / "a.mcap"), ending=ending)
    record = read(tmp_path / "a.mcap")
    assert record.ending == ending
    assert record.controller is None


def test_a_record_is_replayed_in_the_same_blocks(path: Path, tmp_path: Path) -> None:
    listener, again = Listener(), tmp_path / "b.mcap"
    replay(read(path), [listener, RecordWriter(again, controller="mine.py:Mine")])
    assert listener.instances == [INSTANCE]
    assert listener.endings == [Ending(End.DURATION, 75)]
    expected = list(blocks(FRAMES, 30))
    assert len(listener.blocks) == len(expected)
    assert all(same(one, two) for one, two in zip(listener.blocks, expected, strict=True))
    assert again.read_bytes() == path.read_bytes()


def test_equal_trials_make_equal_bytes_and_hold_no_path(path: Path, tmp_path: Path) -> None:
    other = tmp_path / "elsewhere"
    other.mkdir()
    feed(INSTANCE, FRAMES, RecordWriter(other / "b.mcap", controller="mine.py:Mine"))
    data = path.read_bytes()
    assert (other / "b.mcap").read_bytes() == data
    assert str(tmp_path).encode() not in data
    assert b"folder" not in data


def test_a_record_cut_off_anywhere_gives_its_whole_blocks(path: Path) -> None:
    data = path.read_bytes()
    counts = []
    readable = 0
    for length in [*range(0, len(data), 97), *range(len(data) - 40, len(data))]:
        try:
            record = from_bytes(data[:length])
        except RecordError:
            assert not readable, "once readable, readable for good"
            continue
        readable += 1
        counts.append(len(record.frames))
        assert record.instance == INSTANCE
        assert np.array_equal(record.frames.x, FRAMES.x[: len(record.frames)])
        assert record.ending is None or len(record.frames) == 76
    assert sorted(set(counts)) == [0, 30, 60, 76]
    assert counts == sorted(counts)


def test_every_block_is_in_the_file_before_the_next_comes(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordWriter(path)
    writer.begin(INSTANCE)
    assert len(read(path).frames) == 0
    for block in blocks(FRAMES, 30):
        writer.frames(block)
        assert len(read(path).frames) == block.first + len(block)
    writer.close()
    record = read(path)
    assert record.ending is None
    assert same(record.frames, FRAMES)
    listener = Listener()
    replay(record, [listener])
    assert len(listener.blocks) == 3
    assert listener.endings == []


def test_a_killed_writer_leaves_what_it_was_given(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    child = multiprocessing.get_context("spawn").Process(target=_write_two_blocks_and_die, args=(path,))
    child.start()
    child.join()
    assert child.exitcode == -signal.SIGKILL
    record = read(path)
    assert len(record.frames) == 60
    assert record.ending is None


def _write_two_blocks_and_die(path: Path) -> None:
    writer = RecordWriter(path)
    writer.begin(INSTANCE)
    for block, _ in zip(blocks(FRAMES, 30), range(2), strict=False):
        writer.frames(block)
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_block_of_events_without_frames_survives(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordWriter(path)
    writer.begin(INSTANCE)
    early, *_ = blocks(FRAMES, 30)
    columns = {name: getattr(FRAMES, name)[:0] for name in (*REALS, *WHOLE, "bits")}
    empty = Frames(30, 30.0, **columns, events=FRAMES.events)
    writer.frames(early)
    writer.frames(empty)
    writer.end(Ending(End.GAVE_UP, 29))
    record = read(path)
    assert [len(block) for block in record.blocks] == [30, 0]
    assert record.blocks[1].first == 30
    assert record.blocks[1].events == FRAMES.events
    assert record.ending == Ending(End.GAVE_UP, 29)


def test_an_existing_file_stays_unless_told(path: Path) -> None:
    before = path.read_bytes()
    with pytest.raises(InputError, match="exists already"):
        RecordWriter(path).begin(INSTANCE)
    assert path.read_bytes() == before
    wall.write(path, wall.measured(0.5, {}))
    writer = RecordWriter(path, overwrite=True)
    writer.begin(INSTANCE)
    writer.close()
    assert len(read(path).frames) == 0
    assert read(path).wall is None, "the old record's measurements are gone"


def test_a_record_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        RecordWriter(tmp_path / "missing" / "a.mcap").begin(INSTANCE)
    with pytest.raises(InputError):
        RecordWriter(tmp_path).begin(INSTANCE)


def header(**changed: object) -> bytes:
    document = {
        "format": "dubins-traffic record",
        "version": 1,
        "package": "0",
        "libraries": {},
        "controller": None,
    }
    return json.dumps({**document, "instance": {}, **changed}).encode()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_is_named() -> None:
    writer = RecordWriter("/dev/full", overwrite=True)
    with pytest.raises(InputError, match="/dev/full: can't be written: No space left"):
        writer.begin(INSTANCE)
    with pytest.raises(InputError, match="/dev/full"):
        writer.close()
    writer.close()


def foreign(path: Path, topic: str = "/x", message: bytes = b"{}") -> None:
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start("", "other")
        channel = writer.register_channel(topic, "json", 0)
        writer.add_message(channel, 0, message, 0)
        writer.finish()


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"", "not a record"),
        (b"tick,time\n", "not a record"),
        (b"\x89MCAP0\r\n", "cut off before"),
        (b"\x89MCAP0\r\n" + bytes(500), "cut off before"),
    ],
)
def test_what_is_no_record_is_refused(tmp_path: Path, data: bytes, told: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordError, match=told) as error:
        read(path)
    assert str(path) in str(error.value)


@pytest.mark.parametrize(
    ("topic", "message", "told"),
    [
        ("/x", b"{}", "not a record of a trial"),
        ("/trial", b"{}", "not a record of a trial"),
        ("/trial", b"[1]", "not a record of a trial"),
        ("/trial", b"{", "damaged header"),
        ("/trial", b"[" * 100_000, "damaged header"),
        ("/trial", b'{"format": "dubins-traffic record", "version": 2}', "version: unknown version"),
        ("/trial", b'{"format": "dubins-traffic record", "version": 1}', "package: missing"),
        ("/trial", header(libraries=3), "libraries: missing from the header or of a wrong type: got 3"),
        ("/trial", header(instance=[]), "instance: missing"),
        ("/trial", header(controller=1), "controller: missing"),
        ("/trial", header(instance={"version": 1}), "instance"),
    ],
)
def test_other_mcap_files_are_refused(tmp_path: Path, topic: str, message: bytes, told: str) -> None:
    path = tmp_path / "a.mcap"
    foreign(path, topic, message)
    with pytest.raises(RecordError, match=told):
        read(path)


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.mcap"):
        with pytest.raises(RecordError, match="can't be read"):
            read(path)


def test_a_contact_of_an_unknown_car_is_refused(tmp_path: Path) -> None:
    stranger = replace(FRAMES.contacts[0], other=3)
    feed(INSTANCE, replace(FRAMES, contacts=(stranger,)), RecordWriter(tmp_path / "a.mcap"))
    with pytest.raises(RecordError, match="unknown car"):
        read(tmp_path / "a.mcap")


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    changes=st.lists(st.tuples(st.floats(0, 0.999), st.integers(0, 255)), min_size=1, max_size=4),
    end=st.floats(0, 2),
)
def test_damage_anywhere_is_refused_or_read(changes: list[tuple[float, int]], end: float) -> None:
    data = bytearray(WHOLE_FILE.read_bytes())
    for place, value in changes:
        data[int(place * len(data))] = value
    with contextlib.suppress(RecordError):
        record = from_bytes(bytes(data[: int(end * len(data))]) if end < 1 else bytes(data))
        assert len(record.frames) <= 40


def test_a_damaged_block_is_noticed(path: Path) -> None:
    data = bytearray(path.read_bytes())
    where = data.index(FRAMES.x[5].tobytes())
    data[where] ^= 1
    with pytest.raises(RecordError, match="damaged"):
        from_bytes(bytes(data))
    assert len(from_bytes(bytes(data[: where + 8 * 1024])).frames) == 0


def test_the_sidecar_stands_beside_the_record(path: Path) -> None:
    measured = wall.measured(0.25, {"count": 2.0, "mean": 1e-5}, reproducible=False)
    wall.write(path, measured)
    assert wall.sidecar(path) == path.with_name("a.wall.json")
    assert read(path).wall == measured
    document = json.loads(wall.sidecar(path).read_text())
    assert set(document) == {"version", "time_to_begin_s", "act_s", "reproducible", "date", "machine"}
    assert sorted(each.name for each in path.parent.iterdir()) == ["a.mcap", "a.wall.json"]


SIDECAR = '{"version": 1, "time_to_begin_s": 1, "act_s": {}, "reproducible": true, "date": "", "machine": {}}'


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        "[" * 100_000,
        '{"version": 1}',
        '{"version": 9}',
        '{"version": 1, "x": 2}',
        SIDECAR.replace("{}", "[]"),
        SIDECAR.replace("true", "1"),
        SIDECAR.replace('""', "2"),
        SIDECAR.replace('"act_s": {}', '"act_s": {"mean": "soon"}'),
        SIDECAR.replace(": 1, ", ': 1, "transport": 3, '),
        SIDECAR.replace('"time_to_begin_s": 1', '"time_to_begin_s": "soon"'),
    ],
)
def test_a_bad_sidecar_is_refused(path: Path, text: str) -> None:
    wall.sidecar(path).write_text(text)
    with pytest.raises(RecordError, match=r"wall\.json"):
        read(path)
