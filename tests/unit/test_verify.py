"""Verification: honest records are accepted, and each kind of tampering is refused for its own reason."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dubins_traffic as dt
from dubins_traffic.errors import RecordError
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.protocols import End
from dubins_traffic.record import schema, wall
from dubins_traffic.record.reader import from_bytes
from dubins_traffic.record.writer import RecordWriter
from dubins_traffic.runs.single import Trial, run_trial
from dubins_traffic.verification.verify import verify
from tests.recordings import make_instance
from tests.tampering import Chunks, contact_with, cut, edit, find, heading, put, rebuilt

CARS = 3
TICKS = 150
INSTANCE = make_instance(names=("agent0", "agent1"), ticks=TICKS)


class Rammer:
    """Drives straight on into the car ahead, says so, and may give up."""

    def __init__(self, gives_up: int = -1) -> None:
        self.gives_up = gives_up

    def start(self, problem: dt.Problem) -> None:
        self.problem, self.tick = problem, 0

    def act(self, observation: dt.Observation) -> tuple[float, float] | None:
        self.tick = observation.tick
        return None if observation.tick == self.gives_up else (3.0, 0.0)

    def report(self) -> list[tuple[str, str]]:
        return [("mood", "grim")] if self.tick % 40 == 7 else []


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("honest") / "a.mcap"
    result = run_trial(INSTANCE, Rammer(), record=path)
    assert result.score.collisions
    return path.read_bytes()


@pytest.fixture(scope="module")
def given_up(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("given up") / "a.mcap"
    run_trial(INSTANCE, Rammer(gives_up=70), record=path)
    return path.read_bytes()


def outcome(data: bytes, path: Path, instance: Instance | None = None) -> dt.Verification:
    path.write_bytes(data)
    return verify(path, instance=instance)


def test_an_honest_record_is_verified(data: bytes, given_up: bytes, tmp_path: Path) -> None:
    for bytes_ in (data, given_up):
        found = outcome(bytes_, tmp_path / "a.mcap", INSTANCE)
        assert found.verified
        assert str(found) == "verified"
    assert rebuilt(data, lambda _chunks: None) == data, "the tampering of these tests is no other writer"
    assert verify(from_bytes(data)).verified


def test_an_instance_put_together_by_hand_is_verified(tmp_path: Path) -> None:
    """Its document leaves out what has a default, and has whole numbers."""
    agents = tuple(replace(agent, parameters={}) for agent in INSTANCE.e_agents)
    own = replace(INSTANCE, e_agents=agents, duration=3)
    run_trial(own, "simple", record=tmp_path / "a.mcap")
    assert verify(tmp_path / "a.mcap").verified
    spaced = rebuilt(
        (tmp_path / "a.mcap").read_bytes(),
        lambda chunks: edit(chunks, schema.HEADER, 0, lambda text: text.replace(b",", b", ")),
    )
    assert "header" in str(outcome(spaced, tmp_path / "b.mcap"))


def swap(one: str, two: str) -> Callable[[dict[str, Any]], None]:
    def change(document: dict[str, Any]) -> None:
        text = json.dumps(document["cars"]).replace(one, "@").replace(two, one).replace("@", two)
        document["cars"] = json.loads(text)

    return change


def more_frames(chunks: Chunks) -> None:
    """Let the trial go on for a tick after its planned end."""
    m, k = find(chunks, schema.FRAMES, -1)
    row = np.frombuffer(chunks[m][k].data, dtype=schema.frame_dtype(CARS)).copy()
    row["tick"], row["time"] = TICKS + 1, (TICKS + 1) / 30
    chunks[m].insert(k + 1, chunks[m][k]._replace(data=row.tobytes(), sequence=TICKS + 1))


def drop(topic: str, nth: int) -> Callable[[Chunks], None]:
    def change(chunks: Chunks) -> None:
        m, k = find(chunks, topic, nth)
        del chunks[m][k]
        chunks[:] = [chunk for chunk in chunks if chunk]

    return change


def twice(topic: str, nth: int) -> Callable[[Chunks], None]:
    def change(chunks: Chunks) -> None:
        m, k = find(chunks, topic, nth)
        chunks[m].insert(k, chunks[m][k])

    return change


def renamed_end(name: str) -> Callable[[Chunks], None]:
    return lambda chunks: edit(chunks, schema.END, 0, lambda _: schema.pack_strings(name, TICKS, ""))


def later(chunks: Chunks) -> None:
    m, k = find(chunks, schema.FRAMES, 33)
    chunks[m][k] = chunks[m][k]._replace(log_time=chunks[m][k].log_time + 1)


def in_two(chunks: Chunks) -> None:
    """Cut a chunk in two; labels stand at the first frame of each."""
    first = chunks[1]
    frames = [entry for entry in first if entry.topic == schema.FRAMES]
    others = [entry for entry in first if entry.topic != schema.FRAMES]
    chunks[1:2] = [[*frames[:20], *others], frames[20:]]


KINDS: dict[str, tuple[Callable[[Chunks], object], str]] = {
    "pose": (put(schema.FRAMES, 40, "x", 0, lambda x: x + 1e-3, CARS), "x of ego at tick 40"),
    "last bit of a pose": (
        put(schema.FRAMES, 90, "s", 1, lambda s: np.nextafter(s, 2.0), CARS),
        "s of agent0 at tick 90",
    ),
    "start": (put(schema.FRAMES, 0, "y", 2, lambda y: y + 0.1, CARS), "y of agent1 at tick 0"),
    "speed": (put(schema.FRAMES, 12, "speed", 0, 0.5, CARS), "speed of ego at tick 12"),
    "command of the ego": (put(schema.FRAMES, 20, "command_speed", 0, 0.5, CARS), "x of ego at tick 20"),
    "command out of bounds": (
        put(schema.FRAMES, 20, "command_speed", 0, 9.0, CARS),
        "command_speed of ego at tick 20",
    ),
    "command of an e-agent": (
        put(schema.FRAMES, 25, "command_yaw_rate", 2, 0.123, CARS),
        "command_yaw_rate of agent1 at tick 25",
    ),
    "label": (put(schema.LABELS, 1, "bits", 0, lambda bits: bits ^ 4, CARS), "bits of ego at tick"),
    "contact removed": (drop(schema.CONTACTS, 0), "contact of ego at tick"),
    "contact twice": (twice(schema.CONTACTS, 0), "contact of ego at tick"),
    "fault": (
        lambda chunks: edit(chunks, schema.CONTACTS, 0, contact_with(12, lambda fault: not fault)),
        "contact.at_fault of ego",
    ),
    "time of a contact": (
        lambda chunks: edit(chunks, schema.CONTACTS, 0, contact_with(1, lambda time: time + 1e-9)),
        "contact.time of ego",
    ),
    "bounds": (heading(lambda own: own["bounds"].update(speed=9.0)), "header.bounds.speed"),
    "seed": (heading(lambda own: own.update(seed=8)), "header.seed"),
    "names": (heading(swap("agent0", "agent1")), "header.cars[1]"),
    "rate": (heading(lambda own: own.update(rate=60.0)), "header.rate"),
    "a key more": (heading(lambda own: own.update(note="mine")), "header.note"),
    "shorter duration": (heading(lambda own: own["instance"].update(duration=4.0)), "end at tick 120"),
    "longer duration": (heading(lambda own: own["instance"].update(duration=6.0)), "end at tick 150"),
    "end on collision": (heading(lambda own: own["instance"].update(end_on_collision=True)), "end at tick"),
    "another car": (
        heading(
            lambda own: (
                own["bounds"].update(speed=0.4),
                own["instance"]["car"]["bounds"].update(speed=0.4),
            )
        ),
        "header.bounds.speed_min",
    ),
    "healed": (cut(60, "duration"), "end at tick 59"),
    "healed without an end": (cut(60, None), "end of the file"),
    "end": (renamed_end("gave_up"), "end at tick 150"),
    "frames after the end": (more_frames, "end at tick 150"),
    "time of a frame": (put(schema.FRAMES, 33, "time", 0, 1.2, CARS), "time of chunk"),
    "log time": (later, "log_time of chunk"),
    "labels twice": (twice(schema.LABELS, 1), "chunk"),
    "chunks": (in_two, "block 0"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_tampering_is_refused(kind: str, data: bytes, tmp_path: Path) -> None:
    change, told = KINDS[kind]
    altered = rebuilt(data, change)
    assert altered != data
    found = outcome(altered, tmp_path / "a.mcap")
    assert not found.verified
    assert told in str(found), str(found)


UNREADABLE: dict[str, tuple[Callable[[Chunks], object], str]] = {
    "order of chunks": (lambda chunks: chunks.insert(1, chunks.pop(3)), "frames are missing"),
    "frame removed": (drop(schema.FRAMES, 17), "frames are missing"),
    "frame twice": (twice(schema.FRAMES, 17), "frames are missing"),
    "chunk removed": (lambda chunks: chunks.pop(2), "frames are missing"),
    "something after the end": (lambda chunks: chunks.append(chunks[3]), "something follows its end"),
    "no number": (put(schema.FRAMES, 3, "x", 0, np.nan, CARS), "not finite"),
    "a stranger": (
        lambda chunks: edit(chunks, schema.CONTACTS, 0, contact_with(3, 7)),
        "a contact of an unknown car",
    ),
    "number of cars": (
        lambda chunks: edit(chunks, schema.FRAMES, 5, lambda old: old[:12] + b"\2" + old[13:]),
        "does not tell of 3 cars",
    ),
}


@pytest.mark.parametrize("kind", UNREADABLE)
def test_what_is_no_record_any_more_is_unreadable(kind: str, data: bytes, tmp_path: Path) -> None:
    change, told = UNREADABLE[kind]
    with pytest.raises(RecordError, match=told):
        outcome(rebuilt(data, change), tmp_path / "a.mcap")


def test_what_a_controller_reported_is_its_own_affair(data: bytes, tmp_path: Path) -> None:
    found = outcome(rebuilt(data, twice(schema.EVENTS, 0)), tmp_path / "a.mcap")
    assert found.verified
    assert "what the controller reported" in found.unchecked


def test_events_of_the_end_are_compared(given_up: bytes, tmp_path: Path) -> None:
    without = rebuilt(given_up, drop(schema.EVENTS, -1))
    assert "event of ego at tick 70" in str(outcome(without, tmp_path / "a.mcap"))
    other = rebuilt(
        given_up, lambda chunks: edit(chunks, schema.END, 0, lambda _: schema.pack_strings("reset", 70, ""))
    )
    assert not outcome(other, tmp_path / "a.mcap").verified


def test_what_other_programs_add_to_the_file_is_refused(data: bytes, tmp_path: Path) -> None:
    found = outcome(data + b"\0", tmp_path / "a.mcap")
    assert str(found) == f"differs: byte {len(data)} of the file: recorded 00, expected the end of the file"


def test_another_instance_is_refused_where_the_right_one_is_given(data: bytes, tmp_path: Path) -> None:
    other = replace(INSTANCE, problem=replace(INSTANCE.problem, goals=((1, 1),)))
    run_trial(other, Rammer(), record=tmp_path / "b.mcap")
    assert verify(tmp_path / "b.mcap").verified, "it is a trial, of that instance"
    found = verify(tmp_path / "b.mcap", instance=INSTANCE)
    assert str(found) == "differs: instance.goals[0][0]: recorded 1, expected 0"
    assert verify(from_bytes(data), instance=lambda _record: INSTANCE).verified


def test_a_difference_names_the_version_that_wrote_the_record(data: bytes, tmp_path: Path) -> None:
    older = rebuilt(data, heading(lambda own: own.update(package="0.0.1")))
    assert outcome(older, tmp_path / "a.mcap").verified
    altered = rebuilt(older, put(schema.FRAMES, 40, "x", 0, 0.0, CARS))
    told = str(outcome(altered, tmp_path / "a.mcap"))
    assert told.endswith(f"(written by dubins-traffic 0.0.1, this is {dt.__version__})")


def test_the_sidecar_is_not_verified_and_this_is_said(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(data)
    wall.write(tmp_path / "a.mcap", wall.measured(0.5, {}))
    found = verify(tmp_path / "a.mcap")
    assert found.verified
    assert "the sidecar" in found.unchecked
    assert "commands of the ego" in found.unchecked


def test_a_record_cut_off_is_verified_as_far_as_it_goes(data: bytes, tmp_path: Path) -> None:
    ticks = set()
    for length in range(len(data) // 4, len(data), 997):
        found = outcome(data[:length], tmp_path / "a.mcap")
        assert found.verified, found
        assert ("ends early" in str(found)) == (found.end is None)
        ticks.add(found.ticks)
    assert len(ticks) >= 4
    altered = rebuilt(data, put(schema.FRAMES, 40, "x", 0, 0.0, CARS))
    assert not outcome(altered[: int(0.7 * len(altered))], tmp_path / "a.mcap").verified
    whole = outcome(data[:-20], tmp_path / "a.mcap")
    assert (whole.verified, whole.end) == (True, "duration"), "only a part of its index is missing"


@pytest.mark.parametrize(
    "disturbances",
    [
        Disturbances(command_delay=4),
        Disturbances(command_loss=0.5),
        Disturbances(command_delay=2, command_loss=0.3, position_noise=0.1),
    ],
)
def test_delay_and_loss_are_drawn_again(disturbances: Disturbances, tmp_path: Path) -> None:
    given = replace(INSTANCE, disturbances=disturbances)
    run_trial(given, "simple", record=tmp_path / "a.mcap")
    assert verify(tmp_path / "a.mcap").verified
    run_trial(INSTANCE, "simple", record=tmp_path / "b.mcap")
    without = (tmp_path / "b.mcap").read_bytes()
    disturbed = heading(lambda own: own["instance"].update(disturbances=instance_to_document(given)["disturbances"]))
    found = outcome(rebuilt(without, disturbed), tmp_path / "c.mcap")
    assert "command_" in str(found)
    assert "of ego" in str(found)


def test_an_interrupted_trial_may_lack_its_last_frame(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path / "a.mcap")
    with Trial(INSTANCE, sinks=[writer]) as trial:
        for _ in range(40):
            trial.step((0.3, 0.0))
        trial._tick += 1  # as a Ctrl-C between the simulator's step and the push of the frame leaves it
        trial.end(End.INTERRUPTED)
    assert verify(tmp_path / "a.mcap").verified
