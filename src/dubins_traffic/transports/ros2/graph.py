"""A participant in a DDS domain, and topics in it as ROS 2 has them: it is seen there as a node."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, TypeVar

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsParticipant
from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader, Subscriber
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from dubins_traffic.errors import InputError, TransportError
from dubins_traffic.transports.ros2 import messages as m

ALIKE: Final = """<CycloneDDS><Domain><Compatibility><IgnoreTypeInformation>1.15</IgnoreTypeInformation></Compatibility>
</Domain></CycloneDDS>"""
"""Fast DDS (vendor 1.15) describes types otherwise than Cyclone; names tell enough."""
HERE: Final = """<CycloneDDS><Domain><General>
<Interfaces><NetworkInterface address="127.0.0.1" multicast="true"/></Interfaces><AllowMulticast>spdp</AllowMulticast>
</General><Discovery><ParticipantIndex>auto</ParticipantIndex>
<MaxAutoParticipantIndex>60</MaxAutoParticipantIndex><Peers><Peer address="127.0.0.1"/></Peers></Discovery>
</Domain></CycloneDDS>"""
"""Discovery and messages on the loopback interface alone, where nodes of ROS 2 with its defaults are found."""
DEPTH = 10
Message = TypeVar("Message")
LAST_DOMAIN = 232
NODES = "ros_discovery_info"
"""Where participants tell of their nodes."""
SOCKETS: Final = Path("/proc/net/udp")
ADDRESS: Final = re.compile(r"udp/[\d.]+:(\d+)@")
UNKNOWN, GONE = 0, -1
"""In place of a port."""
MOST_PEERS = 1000


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
    node : str
        By which name `ros2 node list` shows it.

    Raises
    ------
    TransportError
        If there can be no participant.
    """

    def __init__(self, domain: int, *, here: bool = True, node: str = "dubins_traffic") -> None:
        try:
            self._domain = _domain(domain, here=here)
            self._participant = DomainParticipant(domain, qos=Qos(said("enclave", "/")))
        except DDSException as error:
            raise TransportError(f"can't take part in DDS domain {domain}: {error}") from error
        self._subscriber, self._publisher = Subscriber(self._participant), Publisher(self._participant)
        self._waitset: Any = WaitSet(self._participant)
        self._conditions: dict[int, Any] = {}
        self._here, self._ports = here, dict[int, int]()
        self._peers: Any = BuiltinDataReader(self._participant, BuiltinTopicDcpsParticipant)
        self._node = m.NodeEntitiesInfo(node_name=node)
        kind = m.ParticipantEntitiesInfo
        self._nodes = DataWriter(
            self._publisher, Topic(self._participant, NODES, kind), qos=quality(latched=True, depth=1)
        )
        self._tell()

    def writer(self, topic: str, kind: Any, *, latched: bool = False) -> Any:
        """Return a writer of messages of type `kind`."""
        qos = quality(latched=latched, depth=1 if latched else DEPTH, of=kind)
        writer = DataWriter(self._publisher, Topic(self._participant, topic, kind), qos=qos)
        self._node.writer_gid_seq.append(_gid(writer))
        self._tell()
        return writer

    def reader(self, topic: str, kind: Any, *, latched: bool = False, lossy: bool = False) -> Any:
        """Return a reader of messages of type `kind`, whose arrival ends a `wait`; latched: of the last one too.

        lossy: also of those who don't send again what got lost.
        """
        qos = quality(latched=latched, lossy=lossy, of=kind)
        reader: Any = DataReader(self._subscriber, Topic(self._participant, topic, kind), qos=qos)
        fresh = ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)
        self._waitset.attach(fresh)
        self._conditions[id(reader)] = fresh
        self._node.reader_gid_seq.append(_gid(reader))
        self._tell()
        return reader

    def drop(self, reader: Any) -> None:
        """Take a reader back."""
        self._node.reader_gid_seq.remove(_gid(reader))
        self._tell()
        self._waitset.detach(self._conditions.pop(id(reader)))
        reader.__del__()

    def heard(self, writer: Any) -> bool:
        """Tell whether somebody reads what is written."""
        return bool(listed(writer.get_matched_subscriptions))

    def writers(self, reader: Any) -> int:
        """Count the writers on the topic of a reader that are still there.

        DDS misses a process that was killed after 10 or 20 seconds; if it was on this machine, its socket is gone.
        """
        writers = listed(reader.get_matched_publications)
        ports = {writer: self._port(reader, writer) for writer in writers} if self._here else {}
        if any(port > 0 for port in ports.values()):
            bound = bound_ports()
            gone = [writer for writer, port in ports.items() if port > 0 and port not in bound]
            self._ports |= dict.fromkeys(gone, GONE)  # another process may take its port
        return sum(self._ports.get(writer) != GONE for writer in writers)

    def _port(self, reader: Any, writer: int) -> int:
        """Return the port at which the participant of a writer listens, UNKNOWN if it is this one or does not tell."""
        about = None if writer in self._ports else reader.get_matched_publication_data(writer)
        if about is not None:
            qos: list[Any] = [
                policy
                for peer in self._peers.read(MOST_PEERS)
                if peer.key == about.participant_key
                for policy in peer.qos
            ]
            told = [ADDRESS.match(policy.value) for policy in qos if isinstance(policy, Policy.Property)]
            self._ports[writer] = next((int(match[1]) for match in told if match), UNKNOWN)
        return self._ports.get(writer, UNKNOWN)

    def put(self, writer: Any, message: Any) -> None:
        """Write a message; one that can't be written at once is dropped, since nobody is waited for."""
        with suppress(DDSException):
            writer.write(message)

    def take(self, reader: Any, kind: type[Message], most: int) -> list[Message]:
        """Take what has come for `reader`, oldest first."""
        return [sample for sample in reader.take(N=most) if isinstance(sample, kind)]

    def wait(self, seconds: float) -> None:
        """Wait until something can be read, so long at most."""
        self._waitset.wait(timeout=duration(nanoseconds=max(1, int(seconds * 1e9))))

    def close(self) -> None:
        """Leave the domain."""
        self._conditions.clear()
        del (
            self._nodes,
            self._peers,
            self._waitset,
            self._subscriber,
            self._publisher,
            self._participant,
            self._domain,
        )

    def _tell(self) -> None:
        """Tell the other participants which readers and writers are the node's."""
        self.put(self._nodes, m.ParticipantEntitiesInfo(_gid(self._participant), [self._node]))


def _domain(domain: int, *, here: bool) -> Domain | None:
    """Return the settings of a domain; None where this process takes part in it already."""
    if here:
        return Domain(domain, f"{HERE},{ALIKE}")
    with suppress(DDSException):
        return Domain(domain, f"{os.environ.get('CYCLONEDDS_URI', '')},{ALIKE}".lstrip(","))
    return None


def _gid(entity: Any) -> m.Gid:
    return m.Gid(list(entity.guid.bytes))


def bound_ports() -> frozenset[int]:
    """Return the ports at which somebody on this machine listens by UDP; all, where the system does not tell."""
    try:
        sockets = SOCKETS.read_text().splitlines()[1:]
    except OSError:
        return frozenset(range(1 << 16))
    return frozenset(int(line.split()[1].partition(":")[2], 16) for line in sockets)


def listed(matched: Callable[[], Sequence[int]]) -> Sequence[int]:
    """Return the peers that `matched` lists.

    Cyclone asks for their number first, and makes room for so many; who comes between makes its list fail by an
    IndexError. They are listed again then.
    """
    while True:
        with suppress(IndexError):
            return matched()


def quality(*, latched: bool, lossy: bool = False, depth: int = DEPTH, of: Any = None) -> Qos:
    """Return ROS 2's quality of service with a history of `depth`, for messages `of` a type.

    latched: who comes late is given the last ones. lossy: what gets lost is not sent again.
    """
    policies: Any = Policy.Durability
    durability = policies.TransientLocal if latched else policies.Volatile
    more = () if of is None else (said("typehash", m.type_hash(of)),)
    history = Policy.History.KeepLast(depth)
    reliability: Any = Policy.Reliability
    reliable = reliability.BestEffort if lossy else reliability.Reliable(duration(milliseconds=1))
    return Qos(reliable, durability, history, *more)


def said(name: str, value: str) -> Any:
    """Return what a participant, a reader or a writer of ROS 2 says of itself beside what DDS knows."""
    return Policy.Userdata(f"{name}={value};".encode())
