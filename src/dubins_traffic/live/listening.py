"""Sockets of servers: one that listens at a place, and its address."""

from __future__ import annotations

import socket

from dubins_traffic.errors import InputError


def listen(host: str, port: int) -> socket.socket:
    """Return a socket that listens at a port of an address of this machine; 0: any port that is free.

    Raises
    ------
    InputError
        If somebody else does, or it is no place of this machine.
    """
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        opened = socket.create_server((host, port), family=family, backlog=1024)
    except OSError as error:
        raise InputError(f"can't listen ({error.strerror or error})", file="--port", value=port) from None
    opened.set_inheritable(False)
    return opened


def address_of(opened: socket.socket) -> str:
    """Return the address of what a socket listens to."""
    name, port = opened.getsockname()[:2]
    host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(str(name), str(name))
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
