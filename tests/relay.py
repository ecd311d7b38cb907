"""A program that passes its standard streams on to a socket, so that a test can speak for it: ``relay.py SOCKET``."""

import os
import select
import socket
import sys


def main() -> None:
    with socket.socket(socket.AF_UNIX) as there:
        there.connect(sys.argv[1])
        ways = {0: there.fileno(), there.fileno(): 1}
        while True:
            for descriptor in select.select(list(ways), [], [])[0]:
                data = os.read(descriptor, 65536)
                if not data:
                    return
                while data:
                    data = data[os.write(ways[descriptor], data) :]


if __name__ == "__main__":
    main()
