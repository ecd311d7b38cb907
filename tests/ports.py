"""Ports of this machine that nobody else gets while the tests run."""

import socket
from contextlib import ExitStack

_KEPT = ExitStack()


def kept_port() -> int:
    """Return a TCP port that only a program which is told of it gets, as long as this process lives.

    A port that is merely free now may be another program's a moment later. A socket that is bound to it and does not
    listen keeps it from who asks for any port; a server that sets ``SO_REUSEADDR``, as servers do, can still bind it.
    """
    keeper = _KEPT.enter_context(socket.socket())
    keeper.bind(("127.0.0.1", 0))
    keeper.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    return int(keeper.getsockname()[1])
