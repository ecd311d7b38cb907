"""Where LCM messages go: URLs, channels, and what to do where there is no way for multicast."""

from __future__ import annotations

import os
import socket
from collections.abc import Generator
from contextlib import contextmanager
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

from dubins_traffic.errors import InputError, MissingExtraError, TransportError

if TYPE_CHECKING:
    from lcm import LCM

DEFAULT_URL = "udpm://239.255.76.67:7667?ttl=0"
"""LCM's own default: multicast that does not leave this machine."""
DEFAULT_GROUP, DEFAULT_PORT = "239.255.76.67", 7667
EXPECTED = "an LCM URL, such as udpm://239.255.76.67:7667?ttl=0"
LONGEST = 63
"""Characters of a channel's name that LCM allows."""

INSTANCE = "TRAFFIC_INSTANCE"
LABELS = "TRAFFIC_LABELS"
WORLD = "TRAFFIC_WORLD"
END = "TRAFFIC_END"
MODE = "TRAFFIC_MODE"
GRANT = "TRAFFIC_GRANT"


def state(car: str) -> str:
    """Return the channel of a car's states."""
    return _checked(f"TRAFFIC_STATE_{car}", car)


def command(car: str) -> str:
    """Return the channel of a car's commands."""
    return _checked(f"TRAFFIC_COMMAND_{car}", car)


def usual_url() -> str:
    """Return the URL that is taken where none is given: that of the environment, as for every LCM program."""
    return os.environ.get("LCM_DEFAULT_URL") or DEFAULT_URL


@contextmanager
def url_of_its_own() -> Generator[str]:
    """Give a URL of multicast within this machine, and keep its port from every program that does not share ports.

    LCM binds its port with ``SO_REUSEADDR``. The socket that keeps the port allows that, too, so LCM can bind the
    port while nobody gets it by asking for any free port.

    Yields
    ------
    str
        A URL; its port is kept until the context ends.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as keeper:
        keeper.bind(("", 0))
        keeper.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        yield f"udpm://{DEFAULT_GROUP}:{keeper.getsockname()[1]}?ttl=0"


def library() -> type[LCM]:
    """Return the library's class of connections.

    MissingExtraError if it is not installed; TransportError if it does not load for want of another library.
    """
    try:
        from lcm import LCM
    except ImportError as error:
        if error.name == "lcm":
            raise MissingExtraError("LCM", "lcm") from error
        raise TransportError(
            "LCM is installed and does not load: its wheel needs GLib; on Debian: apt-get install libglib2.0-0"
        ) from error
    return LCM


def connect(url: str) -> LCM:
    """Return an LCM connection.

    As `library`; TransportError as well if multicast packets have no way to go; the message holds the commands that
    help; InputError if `url` is no URL of LCM.
    """
    made = library()
    check_route(url)
    try:
        return made(url)
    except RuntimeError as error:
        raise InputError("LCM can't be opened", file="--url", value=url, expected=EXPECTED) from error


def check_route(url: str) -> None:
    """See that packets to the multicast group of `url` have a way to go; other URLs than of multicast pass.

    TransportError if they have none; InputError if the group is no address for multicast.
    """
    try:
        parts = urlsplit(url)
        group, port = parts.hostname or DEFAULT_GROUP, parts.port or DEFAULT_PORT
    except ValueError as error:
        raise InputError(str(error), file="--url", value=url, expected=EXPECTED) from error
    if parts.scheme != "udpm":
        return
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((group, port))
            probe.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(group) + b"\0\0\0\0")
        except OSError as error:
            if not _is_multicast(group):
                raise InputError("not a multicast group", file="--url", value=url, expected=EXPECTED) from error
            raise TransportError(
                f"no route for LCM's multicast to {group} ({error.strerror}); this adds one within this machine: "
                "sudo ip link set lo multicast on && sudo ip route add 224.0.0.0/4 dev lo"
            ) from error


def _is_multicast(group: str) -> bool:
    try:
        return 224 <= socket.inet_aton(group)[0] <= 239
    except OSError:
        return False


def _checked(channel: str, car: str) -> str:
    if len(channel) > LONGEST:
        raise InputError(
            "too long a name for LCM",
            field="e-agents",
            value=car,
            expected=f"at most {LONGEST - len(channel) + len(car)} characters",
        )
    return channel
