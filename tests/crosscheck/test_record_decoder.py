"""The record against independent readers: the MCAP library's and a ROS 1 decoder."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from mcap.reader import NonSeekingReader, make_reader
from mcap_ros1.decoder import DecoderFactory

from dubins_traffic.record import schema
from dubins_traffic.record.writer import RecordWriter
from tests.recordings import REALS, WHOLE, feed, make_instance, random_frames

pytestmark = pytest.mark.path

INSTANCE = make_instance(ticks=75)
FRAMES = random_frames(INSTANCE, seed=2, count=76)


@pytest.fixture(scope="module")
def decoded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list]:
    path = tmp_path_factory.mktemp("records") / "a.mcap"
    feed(INSTANCE, FRAMES, RecordWriter(path))
    found: dict[str, list] = {topic: [] for topic in (schema.HEADER, *schema.MESSAGES)}
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        assert reader.get_summary().statistics.chunk_count == 5
        for item in reader.iter_decoded_messages(topics=list(schema.MESSAGES), log_time_order=False):
            found[item.channel.topic].append((item.message.log_time, item.decoded_message))
        for form, _, message in reader.iter_messages(topics=[schema.HEADER]):
            found[schema.HEADER].append((message.log_time, (json.loads(message.data), json.loads(form.data))))
    return found


def test_the_header_obeys_its_schema(decoded: dict[str, list]) -> None:
    [(time, (document, form))] = decoded[schema.HEADER]
    jsonschema.validate(document, form)
    assert time == 0
    assert document["cars"] == ["ego", "agent0", "agent1"]
    assert document["seed"] == 7
    assert document["trial"] == 3
    assert document["bounds"]["yaw_rate"] == np.pi


def test_frames_decode_to_what_was_pushed(decoded: dict[str, list]) -> None:
    messages = decoded[schema.FRAMES]
    assert [message.tick for _, message in messages] == list(range(76))
    assert [message.time for _, message in messages] == [k / 30 for k in range(76)]
    assert [time for time, _ in messages] == [round(k * 1e9 / 30) for k in range(76)]
    for name in REALS:
        assert np.array_equal([getattr(message, name) for _, message in messages], getattr(FRAMES, name))


def test_labels_hold_until_the_next(decoded: dict[str, list]) -> None:
    messages = [message for _, message in decoded[schema.LABELS]]
    assert {0, 30, 60} <= {message.tick for message in messages}
    assert len(messages) < 76
    ends = [*(message.tick for message in messages[1:]), 76]
    for message, end in zip(messages, ends, strict=True):
        for name in (*WHOLE, "bits"):
            held = getattr(FRAMES, name)[message.tick : end]
            assert np.array_equal(held, np.broadcast_to(getattr(message, name), held.shape))


def test_contacts_events_and_end_decode(decoded: dict[str, list]) -> None:
    for (time, message), contact in zip(decoded[schema.CONTACTS], FRAMES.contacts, strict=True):
        assert time == round(contact.time * 1e9)
        for name in ("tick", "time", "car", "other", "x", "y", "nx", "ny"):
            assert getattr(message, name) == getattr(contact, name)
        for name in ("closing", "moved", "at_fault"):
            assert tuple(getattr(message, name)) == getattr(contact, name)
    events = [(event.tick, event.kind, event.car, event.detail) for _, event in decoded[schema.EVENTS]]
    assert events == [(event.tick, event.kind, event.car, event.detail) for event in FRAMES.events]
    [(time, end)] = decoded[schema.END]
    assert (end.end, end.ticks, end.detail) == ("duration", 75, "")
    assert time == 2_500_000_000


def test_a_record_cut_off_still_opens_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    writer = RecordWriter(path)
    writer.begin(INSTANCE)
    writer.frames(FRAMES)
    writer.close()
    with path.open("rb") as file:
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        messages = reader.iter_messages(topics=[schema.FRAMES], log_time_order=False)
        for tick, (_, _, message) in zip(range(76), messages, strict=False):
            assert message.sequence == tick
