"""Records of version 1 stay readable, and their layout changes only with the version.

``data/record-1.mcap`` was written by ``python -m tests.golden.test_record``.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from dubins_traffic.cars.body import DiscObstacle, Rectangle
from dubins_traffic.cars.state import Contact, Event, Frames
from dubins_traffic.protocols import End, Ending
from dubins_traffic.record import schema
from dubins_traffic.record.reader import read
from dubins_traffic.record.writer import RecordWriter
from tests.recordings import REALS, WHOLE, feed, make_frames, make_instance, same

PATH = Path(__file__).parent / "data" / "record-1.mcap"
ENDING = Ending(End.GAVE_UP, 39, "far enough")
INSTANCE = make_instance(
    ticks=60, names=["agent0", "agent1"], body=Rectangle(0.5, 0.25), obstacles=[DiscObstacle(4.5, 0.5, 0.25)]
)


def made_up() -> Frames:
    """Frames of numbers that every machine computes alike."""
    frames = make_frames(INSTANCE, [(k / 64, -0.25) for k in range(40)])
    k = np.arange(40 * 3, dtype=np.float64).reshape(40, 3)
    reals = {name: (k + n) / 8 - 1 for n, name in enumerate(REALS) if name not in ("x", "y", "c", "s")}
    whole = {name: ((k + n) // 32).astype(np.int64) - 1 for n, name in enumerate(WHOLE)}
    contacts = (
        Contact(7, 0.21875, 0, 2, 1.5, -0.25, 0.6, -0.8, (0.5, -0.125), (True, False), (True, False)),
        Contact(33, 1.09375, 1, -1, 4.5, 0.25, 0.0, 1.0, (0.25, 0.0), (True, False), (True, False)),
    )
    events = (Event(39, "gave_up", 0, "far enough"),)
    bits = (k // 16).astype(np.uint32) + 2**31
    return replace(frames, **reals, **whole, bits=bits, contacts=contacts, events=events)


def test_a_record_of_version_1_is_read() -> None:
    record = read(PATH)
    assert record.instance == INSTANCE
    assert same(record.frames, made_up())
    assert [len(block) for block in record.blocks] == [30, 10]
    assert record.ending == ENDING
    assert record.controller == "lanes"
    assert record.versions == {"dubins-traffic": "0.1.0", "mcap": "1.6.0"}


def test_the_layout_is_that_of_version_1() -> None:
    assert schema.VERSION == 1
    with PATH.open("rb") as file:
        summary = make_reader(file).get_summary()
    forms = {
        channel.topic: (
            summary.schemas[channel.schema_id].name,
            summary.schemas[channel.schema_id].data.decode(),
        )
        for channel in summary.channels.values()
    }
    assert list(forms) == [schema.HEADER, *schema.MESSAGES]
    assert {topic: form for topic, form in forms.items() if topic != schema.HEADER} == schema.MESSAGES


def test_todays_writer_makes_the_same_messages(tmp_path: Path) -> None:
    feed(INSTANCE, made_up(), RecordWriter(tmp_path / "a.mcap", controller="lanes"), ending=ENDING)
    assert messages(tmp_path / "a.mcap") == messages(PATH)


def messages(path: Path) -> list[tuple[str, int, int, bytes]]:
    with path.open("rb") as file:
        return [
            (channel.topic, message.log_time, message.sequence, message.data)
            for _, channel, message in make_reader(file).iter_messages(log_time_order=False)
            if channel.topic != schema.HEADER
        ]


if __name__ == "__main__":
    feed(INSTANCE, made_up(), RecordWriter(PATH, controller="lanes", overwrite=True), ending=ENDING)
