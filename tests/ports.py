"""Ports of this machine, and DDS domains, that nobody else gets while the tests run."""

import socket
from contextlib import ExitStack

_KEPT = ExitStack()
LAST_DOMAIN = 232
FIRST_PORT, PORTS = 7400, 250
"""The ports of DDS domain d begin at FIRST_PORT + PORTS d."""


def kept_port() -> int:
    """Return a TCP port that only a program which is told of it gets, as long as this process lives.

    A port that is merely free now may be another program's a moment later. A socket that is bound to it and does not
    listen keeps it from who asks for any port; a server that sets ``SO_REUSEADDR``, as servers do, can still bind it.
    """
    keeper = _KEPT.enter_context(socket.socket())
    keeper.bind(("127.0.0.1", 0))
    keeper.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    return int(keeper.getsockname()[1])


def kept_domain() -> int:
    """Return the number of a DDS domain that no other test gets, as long as this process lives.

    The TCP port of the number of its first port, which DDS does not use, is kept for it.
    """
    for domain in range(1, LAST_DOMAIN + 1):
        keeper = socket.socket()
        try:
            keeper.bind(("127.0.0.1", FIRST_PORT + PORTS * domain))
        except OSError:
            keeper.close()
        else:
            _KEPT.enter_context(keeper)
            return domain
    raise AssertionError("no DDS domain is left")
