"""What the maestro of 2016 served, as services and topics of ROS 2: modes, the instance, pausing, placing cars."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.protocols import Mailbox
from dubins_traffic.transports.maestro import Maestro, Mode
from dubins_traffic.transports.quaternion import placed
from dubins_traffic.transports.ros2 import messages as m
from dubins_traffic.transports.ros2.graph import Graph

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance

INSTANCE = "rt/dubins_traffic_maestro/probleminstance_JSON"
MODE = "dubins_traffic_maestro/mode"
PAUSE, UNPAUSE = "gazebo/pause_physics", "gazebo/unpause_physics"
PLACE = "rt/gazebo/set_model_state"
AT_ONCE = 100
"""Messages of one topic taken at a time."""
MOST_WAITING = 1000
"""Requests that may wait for the next instance; what is asked beyond is never answered."""


@dataclass(frozen=True, slots=True)
class _Service:
    """A service of ROS 2: a topic of requests, one of replies, and who answers, with None for "not yet"."""

    requests: Any
    kind: Any
    replies: Any
    answer: Callable[[Any], Any]


class MaestroServices:
    """Answers requests, and tells the problem.

    Parameters
    ----------
    graph : Graph
        Where.
    mailbox : Mailbox
        Where requests go.
    maestro : Maestro, optional
        Who answers mode requests; without one there is no mode service.
    """

    def __init__(self, graph: Graph, mailbox: Mailbox, maestro: Maestro | None) -> None:
        self._graph, self._mailbox, self._maestro = graph, mailbox, maestro
        self._problem = graph.writer(INSTANCE, m.ProblemInstanceJSON, latched=True)
        self._places = graph.reader(PLACE, m.ModelState)
        self._waiting: list[tuple[_Service, Any]] = []
        self._services = [
            self._service(PAUSE, m.EmptyRequest, m.EmptyReply, partial(self._pause, True)),
            self._service(UNPAUSE, m.EmptyRequest, m.EmptyReply, partial(self._pause, False)),
        ]
        if maestro is not None:
            self._services.append(self._service(MODE, m.ModeRequest, m.ModeReply, self._mode))

    def begin(self) -> None:
        """Take back the end of the trial before: who comes now would take it for the next one's."""
        self._graph.lift(self._problem, m.ProblemInstanceJSON)

    def announce(self, instance: Instance, stamp: m.Time) -> None:
        """Publish the problem, latched, as in 2016."""
        self._publish(json.dumps(instance_to_document(instance, version=0)), stamp)

    def end(self, stamp: m.Time) -> None:
        """Publish that the trial is over."""
        self._publish("", stamp)

    def serve(self) -> None:
        """Answer what has been asked."""
        asked, self._waiting = self._waiting, []
        for service in self._services:
            asked += [(service, one) for one in self._graph.take(service.requests, service.kind, AT_ONCE)]
        for service, request in asked:
            reply = service.answer(request)
            if reply is not None:
                self._graph.put(service.replies, reply)
            elif len(self._waiting) < MOST_WAITING:
                self._waiting.append((service, request))
        for message in self._graph.take(self._places, m.ModelState, AT_ONCE):
            position, turn = message.pose.position, message.pose.orientation
            pose = placed(position.x, position.y, turn.z, turn.w)
            if pose is not None:
                self._mailbox.place(message.model_name, pose)

    def _service(self, name: str, request: Any, reply: Any, answer: Callable[[Any], Any]) -> _Service:
        requests = self._graph.reader(f"rq/{name}Request", request)
        return _Service(requests, request, self._graph.writer(f"rr/{name}Reply", reply), answer)

    def _publish(self, text: str, stamp: m.Time) -> None:
        self._graph.put(self._problem, m.ProblemInstanceJSON(stamp, text))

    def _mode(self, request: m.ModeRequest) -> m.ModeReply | None:
        assert self._maestro is not None
        granted = self._maestro.answer(request.mode)
        if granted is None:
            return None
        if granted and request.mode == Mode.START:
            self._mailbox.pause(False)
        return m.ModeReply(request.guid, request.seq, granted)

    def _pause(self, paused: bool, request: m.EmptyRequest) -> m.EmptyReply:
        self._mailbox.pause(paused)
        return m.EmptyReply(request.guid, request.seq)
