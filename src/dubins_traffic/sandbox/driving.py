"""The other side of a controller in a box: what the shim answers to each message. Runs in the box."""

from __future__ import annotations

import base64
import pickle
from collections.abc import Mapping
from typing import Any

from dubins_traffic.controllers import blame
from dubins_traffic.controllers.registry import load
from dubins_traffic.errors import ControllerError, InputError
from dubins_traffic.problem.instance import Problem
from dubins_traffic.protocols import Closes, Controller, Reports
from dubins_traffic.transports.line_messages import observation_from_document
from dubins_traffic.trial.endings import checked_command
from dubins_traffic.trial.seat import checked_reports


class Driving:
    """Drives one trial with the controller at `spec`, and says by the messages of lines what comes of it."""

    def __init__(self, spec: str) -> None:
        self._spec = spec
        self._controller: Controller | None = None
        self._problem: Problem | None = None
        self._tick = 0
        self.done = False

    def answer(self, message: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the answer to a message, if it has one; whatever the controller raises is its fault."""
        try:
            if "frame" in message:
                return self._act(message["frame"])
            if "pickled" in message:
                return self._start(pickle.loads(base64.b64decode(message["pickled"])))
            if "problem" in message:
                from dubins_traffic.problem.public_problem import problem_from_document

                self._start(problem_from_document(message["problem"]))
                return None
            return self._close()
        except ControllerError as error:
            return {"fault": error.detail}
        except InputError as error:
            return {"fault": blame.error_text(error, self._tick)}
        except KeyboardInterrupt:
            raise
        except BaseException as error:
            blame.show(error)
            return {"fault": blame.error_text(error, None if self.done else self._tick)}

    def _start(self, problem: Problem) -> dict[str, Any]:
        self._problem = problem
        self._controller = load(self._spec)
        self._controller.start(problem)
        return {"started": True}

    def _act(self, document: Mapping[str, Any]) -> dict[str, Any]:
        assert self._problem is not None
        assert self._controller is not None
        seen = observation_from_document(document, self._problem)
        self._tick = seen.tick
        command = self._controller.act(seen)
        made_reports = checked_reports(self._controller.report()) if isinstance(self._controller, Reports) else []
        if command is None:
            return {"bye": f"the controller gave up at tick {seen.tick}"}
        reports = {"reports": made_reports} if made_reports else {}
        return {"command": checked_command(command, seen.tick), "tick": seen.tick, **reports}

    def _close(self) -> dict[str, Any]:
        self.done = True
        if isinstance(self._controller, Closes):
            self._controller.close()
        return {"closed": True}
