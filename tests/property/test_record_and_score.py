"""What holds of every trial: records round-trip, and scores do not depend on how frames come."""

import csv
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dubins_traffic.cars.body import Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import Frames
from dubins_traffic.interchange.export import COLUMNS, export
from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record.reader import from_bytes, read
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.scoring.score import Scorer, score
from tests.recordings import blocks, feed, make_instance, random_frames, same

OBSTACLES = (DiscObstacle(4.0, 1.5, 0.2), PolygonObstacle(((1.0, 1.0), (2.0, 1.0), (1.0, 2.0))))


@st.composite
def trials(draw: st.DrawFn) -> tuple[Instance, Frames]:
    rate = draw(st.sampled_from([30.0, 7.5, 29.97, 100.0]))
    count = draw(st.integers(2, 120))
    instance = make_instance(
        goals=draw(st.sampled_from([(), ((0, 0),), ((0, 0), (1, 1)), ((1, 1), (1, 1), (0, 1))])),
        names=draw(st.sampled_from([(), ("agent0",), ("agent0", "truck", "agent2")])),
        ticks=count - 1,
        rate=rate,
        body=draw(st.sampled_from([Disc(), Rectangle(0.5, 0.3)])),
        obstacles=draw(st.sampled_from([(), OBSTACLES])),
    )
    return instance, random_frames(instance, draw(st.integers(0, 2**32)), count)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("records")


@settings(max_examples=60, deadline=None, derandomize=True)
@given(trial=trials())
def test_live_and_recorded_scores_are_equal(folder: Path, trial: tuple[Instance, Frames]) -> None:
    instance, frames = trial
    path = folder / "a.mcap"
    live = Scorer()
    feed(instance, frames, live, RecordWriter(path, controller="lanes", overwrite=True))
    record = read(path)
    assert record.instance == instance
    assert same(record.frames, frames)
    assert score(record) == live.result(controller="lanes", record=path)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(trial=trials(), sizes=st.lists(st.integers(1, 60), min_size=1, max_size=4))
def test_scores_do_not_depend_on_the_blocks(trial: tuple[Instance, Frames], sizes: list[int]) -> None:
    instance, frames = trial
    results = []
    for size in {*sizes, len(frames)}:
        with patch("dubins_traffic.scoring.score._BLOCK", size):
            scorer = Scorer()
            scorer.begin(instance)
            for block in blocks(frames, size):
                scorer.frames(block)
            scorer.end(Ending(End.DURATION, len(frames) - 1))
            results.append(scorer.result())
    assert all(result == results[0] for result in results)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(trial=trials(), share=st.floats(0.0, 1.0))
def test_a_record_cut_off_scores_as_the_part_that_is_left(
    folder: Path, trial: tuple[Instance, Frames], share: float
) -> None:
    instance, frames = trial
    path = folder / "b.mcap"
    writer = RecordWriter(path, overwrite=True)
    writer.begin(instance)
    start = path.stat().st_size
    writer.close()
    feed(instance, frames, RecordWriter(path, overwrite=True))
    data = path.read_bytes()
    record = from_bytes(data[: start + int(share * (len(data) - start))])
    scorer = Scorer()
    scorer.begin(instance)
    for block in blocks(frames, max(1, int(frames.rate))):
        if block.first < len(record.frames):
            scorer.frames(block)
    expected = scorer.result()
    found = score(record)
    assert found.to_json() | {"end": None} == expected.to_json()
    assert found.end in (None, "duration")


@settings(max_examples=15, deadline=None, derandomize=True)
@given(trial=trials())
def test_tables_hold_the_frames_bit_for_bit(folder: Path, trial: tuple[Instance, Frames]) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    instance, frames = trial
    feed(instance, frames, RecordWriter(folder / "c.mcap", overwrite=True))
    record = read(folder / "c.mcap")
    for name in ("c.csv", "c.parquet"):
        export(record, folder / name, overwrite=True)
    with (folder / "c.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert tuple(head) == COLUMNS
    table = parquet.read_table(folder / "c.parquet")
    assert tuple(table.column_names) == COLUMNS
    cars = len(instance.names)
    for k, name in enumerate(COLUMNS):
        column = [row[k] for row in rows]
        if name == "car":
            expected = list(instance.names) * len(frames)
            assert column == table[name].to_pylist() == expected
        elif name in ("tick", "time"):
            expected = np.repeat(np.arange(len(frames)) / (1 if name == "tick" else frames.rate), cars)
            assert np.array_equal(np.array(column, dtype=float), expected)
            assert np.array_equal(table[name].to_numpy(), expected)
        else:
            expected = getattr(frames, name).reshape(-1)
            assert np.array([float(cell) for cell in column]).tobytes() == expected.tobytes()
            assert table[name].to_numpy().tobytes() == expected.tobytes()
