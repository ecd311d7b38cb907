"""A participant in a DDS domain, and topics in it as ROS 2 has them."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any, TypeVar

from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from dubins_traffic.errors import InputError, TransportError

HERE = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>60</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Discovery and messages on the loopback interface alone, as ROS_LOCALHOST_ONLY=1 has it."""
DEPTH = 10
Message = TypeVar("Message")
LAST_DOMAIN = 232


def usual_domain() -> int:
    """Return the domain that the environment names, 0 without one.

    InputError if ``ROS_DOMAIN_ID`` is no number of a domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not text.isdecimal() or int(text) > LAST_DOMAIN:
        expected = f"a number from 0 to {LAST_DOMAIN}"
        raise InputError("not a domain", file="ROS_DOMAIN_ID", value=text, expected=expected)
    return int(text)


class Graph:
    """A participant with its readers and writers.

    Parameters
    ----------
    domain : int
        Number of the DDS domain, 0 to 232.
    here : bool
        Whether nothing leaves this machine; else what ``CYCLONEDDS_URI`` says, or Cyclone's defaults, hold.

    Raises
    ------
    TransportError
        If there can be no participant.
    """

    def __init__(self, domain: int, *, here: bool = True) -> None:
        try:
            self._domain = Domain(domain, HERE) if here else None
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise TransportError(f"can't take part in DDS domain {domain}: {error}") from error
        self._subscriber, self._publisher = Subscriber(self._participant), Publisher(self._participant)
        self._waitset: Any = WaitSet(self._participant)
        self._conditions: dict[int, Any] = {}

    def writer(self, topic: str, kind: Any, *, latched: bool = False) -> Any:
        """Return a writer of messages of type `kind`."""
        qos = quality(latched=latched, depth=1 if latched else DEPTH)
        return DataWriter(self._publisher, Topic(self._participant, topic, kind), qos=qos)

    def reader(self, topic: str, kind: Any, *, latched: bool = False) -> Any:
        """Return a reader of messages of type `kind`, whose arrival ends a `wait`; latched: of the last one too."""
        qos = quality(latched=latched, depth=DEPTH)
        reader: Any = DataReader(self._subscriber, Topic(self._participant, topic, kind), qos=qos)
        fresh = ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)
        self._waitset.attach(fresh)
        self._conditions[id(reader)] = fresh
        return reader

    def drop(self, reader: Any) -> None:
        """Take a reader back."""
        self._waitset.detach(self._conditions.pop(id(reader)))
        reader.__del__()

    def heard(self, writer: Any) -> bool:
        """Tell whether somebody reads what is written."""
        return bool(counted(writer.get_matched_subscriptions))

    def writers(self, reader: Any) -> int:
        """Count who writes what is read."""
        return counted(reader.get_matched_publications)

    def put(self, writer: Any, message: Any) -> None:
        """Write a message; one that can't be written at once is dropped, since nobody is waited for."""
        with suppress(DDSException):
            writer.write(message)

    def lift(self, writer: Any, kind: Any) -> None:
        """Take back what a writer has latched: who comes from here on is not given it."""
        with suppress(DDSException):
            writer.dispose(kind())

    def take(self, reader: Any, kind: type[Message], most: int) -> list[Message]:
        """Take what has come for `reader`, oldest first."""
        return [sample for sample in reader.take(N=most) if isinstance(sample, kind)]

    def wait(self, seconds: float) -> None:
        """Wait until something can be read, so long at most."""
        self._waitset.wait(timeout=duration(nanoseconds=max(1, int(seconds * 1e9))))

    def close(self) -> None:
        """Leave the domain."""
        self._conditions.clear()
        del self._waitset, self._subscriber, self._publisher, self._participant, self._domain


def counted(matched: Callable[[], Sequence[int]]) -> int:
    """Count the peers that `matched` lists.

    Cyclone asks for their number first, and makes room for so many; who comes between makes its list fail by an
    IndexError. They are counted again then.
    """
    while True:
        with suppress(IndexError):
            return len(matched())


def quality(*, latched: bool, depth: int) -> Qos:
    """Return ROS 2's quality of service with a history of `depth`; latched: who comes late is given the last ones."""
    policies: Any = Policy.Durability
    durability = policies.TransientLocal if latched else policies.Volatile
    history = Policy.History.KeepLast(depth)
    return Qos(Policy.Reliability.Reliable(duration(milliseconds=1)), durability, history)
