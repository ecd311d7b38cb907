"""Damage in a record's file is detected or harmless: it is never a traceback, and nothing is ever read wrong."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.errors import RecordError
from dubins_traffic.record.chunks import is_finished, pieces
from dubins_traffic.record.reader import Record, from_bytes, read
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.runs.single import run_trial
from tests.recordings import feed, make_instance, random_frames, same
from tests.tampering import damaged, length_at

INSTANCE = make_instance(names=("agent0",), ticks=24, rate=10.0)
FRAMES = random_frames(INSTANCE, seed=3, count=25)
PROGRAM = [sys.executable, "-m", "dubins_traffic.cli"]


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "a.mcap"
    feed(INSTANCE, FRAMES, RecordWriter(path, controller="mine"))
    return path.read_bytes()


@pytest.fixture(scope="module")
def cut_off(data: bytes) -> bytes:
    return data[: list(pieces(data))[2].end + 500]


def harmless(found: Record, whole: Record) -> bool:
    """Whether all is as it was written."""
    return (
        found.instance == whole.instance
        and same(found.frames, whole.frames)
        and found.ending == whole.ending
        and found.controller == whole.controller
        and found.versions == whole.versions
        and [len(block) for block in found.blocks] == [len(block) for block in whole.blocks]
    )


def begins(found: Record, whole: Record) -> bool:
    """Whether it reads as the same record, cut off earlier."""
    count = len(found.frames)
    return found.instance == whole.instance and (found.frames.x == whole.frames.x[:count]).all()


def check(altered: bytes, whole: Record) -> None:
    """Read a damaged file: it is refused with its name, or nothing of it is wrong."""
    try:
        found = from_bytes(altered, "a.mcap")
    except RecordError as error:
        refusal = str(error)
    else:
        assert harmless(found, whole) or (not is_finished(altered) and begins(found, whole))
        return
    assert refusal.startswith("a.mcap: ")


def test_every_bit_of_the_lengths_and_heads(data: bytes, cut_off: bytes) -> None:
    """The first bytes of all MCAP records, where their kinds, lengths and checksums stand."""
    for file in (data, cut_off):
        whole = from_bytes(file)
        for at in [*range(8, 40), *heads(file), *range(len(file) - 60, len(file))]:
            for bit in (0, 3, 7):
                check(damaged(file, at, bytes([file[at] ^ 1 << bit])), whole)


def heads(data: bytes) -> list[int]:
    """Return the bytes in which chunks and their indexes begin."""
    found: list[int] = []
    for piece in pieces(data):
        found += range(piece.first, piece.first + 52)
        if piece.end + 20 <= len(data):
            found += range(piece.end, piece.end + 20)
    return found


@settings(max_examples=250, deadline=None, derandomize=True)
@given(place=st.floats(0, 1, exclude_max=True), bit=st.integers(0, 7), whole=st.booleans())
def test_a_bit_anywhere(place: float, bit: int, whole: bool, data: bytes, cut_off: bytes) -> None:
    file = data if whole else cut_off
    at = int(place * len(file))
    check(damaged(file, at, bytes([file[at] ^ 1 << bit])), from_bytes(file))


@settings(max_examples=200, deadline=None, derandomize=True)
@given(
    place=st.floats(0, 1, exclude_max=True),
    noise=st.one_of(
        st.binary(min_size=1, max_size=64),
        st.integers(1, 30_000).map(bytes),
        st.integers(1, 999).map(b"\xff".__mul__),
    ),
    whole=st.booleans(),
)
def test_a_range_of_bytes(place: float, noise: bytes, whole: bool, data: bytes, cut_off: bytes) -> None:
    file = data if whole else cut_off
    at = int(place * len(file))
    check(damaged(file, at, noise[: len(file) - at]), from_bytes(file))


@pytest.mark.parametrize("length", [0, 1, 7, 10**4, 10**14, 2**63, 2**64 - 1])
def test_a_length_is_damage_where_the_end_is_there(length: int, data: bytes, cut_off: bytes) -> None:
    for piece in pieces(data):
        with pytest.raises(RecordError, match="damaged") as error:
            from_bytes(length_at(data, piece.first, length))
        assert "byte" in str(error.value)
    for piece in pieces(cut_off):
        with pytest.raises(RecordError, match="damaged"):
            from_bytes(length_at(cut_off, piece.first, length))


def test_claims_of_many_rows_are_refused(data: bytes) -> None:
    piece = list(pieces(data))[1]
    inside = piece.first + 9 + 40
    huge = length_at(data, inside, 10**14)
    with pytest.raises(RecordError, match="does not match its checksum"):
        from_bytes(huge)
    assert struct.unpack_from("<Q", huge, inside + 1)[0] == 10**14


def test_a_chunk_that_zeros_follow_is_cut_off(data: bytes) -> None:
    """A file system that lost power leaves zeros."""
    third = list(pieces(data))[2]
    found = from_bytes(data[: third.end] + bytes(5000))
    assert len(found.frames) == 20


def command(*arguments: str, stdin: bytes | None = None) -> tuple[int, str]:
    ran = subprocess.run([*PROGRAM, *arguments], input=stdin, capture_output=True, timeout=600, check=False, cwd="/")
    return ran.returncode, ran.stderr.decode()


@pytest.mark.parametrize("name", ["verify", "check", "score"])
def test_a_file_that_never_ends_is_wrong_input(name: str) -> None:
    status, told = command(name, "/dev/zero")
    assert (status, told.count("\n")) == (2, 1)
    assert "/dev/zero: not a record" in told


def test_a_pipe_is_read_once_and_one_that_never_ends_is_refused(tmp_path: Path) -> None:
    fifo, record = tmp_path / "fifo", tmp_path / "a.mcap"
    os.mkfifo(fifo)
    run_trial(INSTANCE, "simple", record=record)

    def pour() -> None:
        with fifo.open("wb") as stream:
            stream.write(record.read_bytes())

    def flood() -> None:
        try:
            with fifo.open("wb") as stream:
                while True:
                    stream.write(bytes(1 << 16))
        except BrokenPipeError:
            return

    writer = threading.Thread(target=pour)
    writer.start()
    assert command("verify", str(fifo)) == (0, "")
    writer.join()
    writer = threading.Thread(target=flood)
    writer.start()
    status, told = command("verify", str(fifo))
    writer.join()
    assert status == 2
    assert "not a record" in told
    assert command("verify", "-", stdin=record.read_bytes()) == (0, "")
    assert len(read(record).frames) == 25


def test_a_record_that_goes_on_for_ever_is_refused(
    data: bytes, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(data)
    monkeypatch.setattr("dubins_traffic.record.reader.LARGEST", len(data) - 1)
    with pytest.raises(RecordError, match="does not end; expected a record of at most"):
        read(path)
