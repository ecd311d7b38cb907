"""The other end of `lines`: drives a car with a controller of this package's protocol, from any process."""

from __future__ import annotations

import json
import socket
from typing import Any, cast

from dubins_traffic.problem.public_problem import problem_from_document
from dubins_traffic.protocols import Closes, Controller
from dubins_traffic.transports.line_messages import observation_from_document

PATIENCE = 120.0


def drive(address: tuple[str, int], controller: Controller, car: str = "ego") -> dict[str, Any]:
    """Drive `car` through one trial and return how it ended: end, ticks, detail.

    Parameters
    ----------
    address : (str, int)
        Host and port of the trial.
    controller : Controller
        Is started with the problem and asked once a tick.

    Raises
    ------
    OSError
        If there is nobody at `address`, or nothing comes for two minutes.
    EOFError
        If the connection ends before the trial.
    """
    problem, answered = None, -1
    with socket.create_connection(address, PATIENCE) as connection, connection.makefile("rb") as lines:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        _send(connection, {"join": car})
        for line in lines:
            message = json.loads(line)
            if "problem" in message:
                problem = problem_from_document(message["problem"])
                controller.start(problem)
            elif "frame" in message and problem is not None and message["frame"]["tick"] > answered:
                observation = observation_from_document(message["frame"], problem)
                command = controller.act(observation)
                answered = observation.tick
                if command is None:
                    _send(connection, {"bye": f"the controller gave up at tick {answered}"})
                else:
                    _send(connection, {"command": [float(command[0]), float(command[1])], "tick": answered})
            elif "end" in message:
                if isinstance(controller, Closes):
                    controller.close()
                return cast("dict[str, Any]", message["end"])
    raise EOFError("the connection ended before the trial")


def _send(connection: socket.socket, message: dict[str, Any]) -> None:
    connection.sendall(json.dumps(message).encode() + b"\n")
