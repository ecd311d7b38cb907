"""A recorded trial as if it ran: its frames go to the feed at the clock's pace, also while the record is written."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from time import monotonic, sleep
from typing import Final

from dubins_traffic.cars.state import Contact, Frames, Labels, State
from dubins_traffic.live.feed import Feed
from dubins_traffic.observations.senses import Senses
from dubins_traffic.record.reader import Record
from dubins_traffic.runs.sources import load_record

QUIET_S: Final = 10.0
"""Seconds after which a record without an end that has not grown is taken to be cut off."""
LOOK_S: Final = 0.5
"""Seconds between two looks at a record that grows."""


def show(feed: Feed, source: str, record: Record) -> Record:
    """Show the trial of a record to a feed; one without an end is read again as it grows.

    Parameters
    ----------
    feed : Feed
        Shows it.
    source : str
        Where it was read from.
    record : Record
        What was read.

    Returns
    -------
    Record
        What was read last.
    """
    senses = Senses(record.instance)
    cars = len(record.instance.names)
    state, labels = State.zeros(1, cars), Labels.zeros(1, cars)
    feed.begin(record.instance)
    shown, last = 0, record
    for last in _as_it_grows(source, record):
        for tick, contacts in _frames(last.frames, shown, state, labels):
            feed.watch(tick, state, labels, contacts, partial(senses.observe, tick, state, labels))
        shown = len(last.frames)
    return last


def _as_it_grows(source: str, record: Record) -> Iterator[Record]:
    """Yield the record, and again each time that it has grown, until it has an end or has not grown for long."""
    yield record
    grown = monotonic()
    while record.ending is None and monotonic() - grown < QUIET_S:
        sleep(LOOK_S)
        again = load_record(source)
        if len(again.frames) > len(record.frames) or again.ending is not None:
            record, grown = again, monotonic()
            yield record


def _frames(frames: Frames, begin: int, state: State, labels: Labels) -> Iterator[tuple[int, Sequence[Contact]]]:
    """Write the frames from `begin` on into `state` and `labels` (1, N), and yield the tick and contacts of each."""
    states, labelled = frames.states
    contacts: dict[int, list[Contact]] = {}
    for contact in frames.contacts:
        contacts.setdefault(contact.tick, []).append(contact)
    for f in range(begin, len(frames)):
        for present, all_frames in zip((*state[:6], *labels), (*states[:6], *labelled), strict=True):
            present[0] = all_frames[f]
        yield frames.first + f, contacts.get(frames.first + f, ())
