"""What poses tell whatever a record says: contacts found again, and worlds that are not ours."""

from dataclasses import replace
from pathlib import Path

import pytest

from dubins_traffic.record import schema
from dubins_traffic.record.reader import from_bytes
from dubins_traffic.runs.single import run_trial
from dubins_traffic.verification.worlds import from_poses
from tests.tampering import Chunks, contact_with, edit, heading, put, rebuilt
from tests.unit.test_verify import CARS, INSTANCE, Rammer, drop, outcome, renamed_end


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("honest") / "a.mcap"
    run_trial(INSTANCE, Rammer(), record=path)
    return path.read_bytes()


def test_poses_tell_the_contacts_that_a_record_conceals(data: bytes) -> None:
    honest, concealed = from_bytes(data), from_bytes(rebuilt(data, drop(schema.CONTACTS, 0)))
    assert from_poses(honest).frames.contacts == honest.frames.contacts
    assert concealed.frames.contacts == honest.frames.contacts[1:]
    assert from_poses(concealed).frames.contacts == honest.frames.contacts


def test_bodies_that_overlap_in_frames_touch(data: bytes) -> None:
    """The car ahead has been put onto the ego for some frames; the commands would never bring it there."""
    record = from_bytes(data)
    frames = replace(record.frames, x=record.frames.x.copy(), y=record.frames.y.copy(), contacts=())
    first = record.frames.contacts[0].tick - 20
    frames.x[first : first + 5, 2] = frames.x[first : first + 5, 0]
    frames.y[first : first + 5, 2] = frames.y[first : first + 5, 0] + 0.2
    found = from_poses(replace(record, frames=frames)).frames.contacts
    assert (found[0].tick, found[0].car, found[0].other) == (first, 0, 2)
    assert [contact.other for contact in found].count(2) == 1


def test_worlds_that_are_not_ours_keep_bounds_and_contacts(data: bytes, tmp_path: Path) -> None:
    elsewhere = heading(lambda own: own["instance"].update(simulator="gazebo"))
    there = rebuilt(data, elsewhere)
    found = outcome(there, tmp_path / "a.mcap")
    assert str(found) == "verified, in the world gazebo: frames fit the bounds, contacts the poses"
    assert any("the world is gazebo" in one for one in found.unchecked)
    for change, told in (
        (put(schema.FRAMES, 40, "x", 0, lambda x: x + 0.3, CARS), "metres moved"),
        (put(schema.FRAMES, 40, "c", 0, lambda c: -c, CARS), "radians turned"),
        (put(schema.FRAMES, 40, "c", 0, lambda c: 2 * c, CARS), "length of the heading"),
        (put(schema.LABELS, 1, "bits", 0, lambda bits: bits ^ 4, CARS), "bits of ego"),
        (put(schema.FRAMES, 40, "command_speed", 1, 0.1, CARS), "command_speed of agent0"),
        (lambda chunks: edit(chunks, schema.CONTACTS, 0, contact_with(3, 2)), "gap at a contact with agent1"),
        (lambda chunks: edit(chunks, schema.CONTACTS, 0, contact_with(1, 0.0)), "contact.time"),
        (renamed_end("collision"), "end"),
    ):
        altered = outcome(rebuilt(there, change), tmp_path / "a.mcap")
        assert told in str(altered), str(altered)


def test_an_overlap_without_a_contact_is_refused_elsewhere(data: bytes, tmp_path: Path) -> None:
    record = from_bytes(data)
    tick = record.frames.contacts[0].tick

    def press(chunks: Chunks) -> None:
        """Push the ego slowly into the car ahead, without a word of a contact."""
        for k in range(tick, tick + 10):
            put(schema.FRAMES, k, "x", 0, lambda x, k=k: x + 0.002 * (k - tick + 1), CARS)(chunks)
        drop(schema.CONTACTS, 0)(chunks)
        heading(lambda own: own["instance"].update(simulator="gazebo"))(chunks)

    found = outcome(rebuilt(data, press), tmp_path / "a.mcap")
    assert "contact" in str(found)
    assert "overlap" in str(found), str(found)
