"""A node of the ROS graph, which a process is once: joining, watching the master, leaving."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from threading import Event, Thread
from time import sleep
from typing import Any

from dubins_traffic.errors import TransportError
from dubins_traffic.transports.ros1.master import answers
from dubins_traffic.transports.ros1.messages import ros

NAME = "dubins_traffic_maestro"
REFEREE = "dubins_traffic_referee"
"""Name of this process where the maestro is another one."""
LOOK = 0.1
"""Seconds between two looks at who is connected."""
PING = 1.0
"""Seconds between two calls of the master."""
GRACE = 0.5
MISSED = 2
"""Calls of the master in a row that may go unanswered, and one more."""


def join(uri: str, name: str = NAME) -> Any:
    """Make this process the node `name` at the master `uri` and return rospy; once in the life of a process.

    Raises
    ------
    TransportError
        If nobody answers at `uri`, a maestro is there already, or this process is a node elsewhere.
    MissingRosError
        If rospy is not installed.
    """
    rospy = ros("rospy")
    if rospy.core.is_initialized():
        if rospy.is_shutdown() or os.environ.get("ROS_MASTER_URI") != uri:
            raise TransportError("this process has been a ROS node before; rospy allows one in its life")
        return rospy
    if not answers(uri):
        raise TransportError(f"no ROS master answers at {uri}: start roscore, set ROS_MASTER_URI, or say --master")
    os.environ["ROS_MASTER_URI"] = uri
    taken = _node_at(uri, name)
    if taken is not None and answers(taken):
        other = "; --maestro-elsewhere leaves trials to it" if name == NAME else ""
        raise TransportError(f"the ROS master at {uri} has a maestro already: /{name} at {taken}{other}")
    rospy.init_node(name, argv=[], disable_signals=True, disable_rosout=True)
    return rospy


def leave() -> None:
    """Take this process out of the graph, if it is a node; it can't join again."""
    rospy = sys.modules.get("rospy")
    if rospy is not None and rospy.core.is_initialized():
        rospy.signal_shutdown("the session is over")


def tell_first(rospy: Any, hook: Callable[[str], None]) -> None:
    """Let `hook` be told why this node is shut down before anything of it is closed.

    rospy's own first hook closes all topics, and then talks to the master for a while: who publishes meanwhile fails,
    and could not say why.
    """
    with rospy.core._shutdown_lock:
        rospy.core._preshutdown_hooks.insert(0, hook)


def abandon(rospy: Any, detail: str) -> None:
    """Leave a graph whose master has gone.

    A registration that is under way waits for the master until rospy is shut down, and the shutdown waits for it; so
    it is let go first.
    """
    rospy.core._shutdown_flag = True
    sleep(GRACE)
    rospy.core._shutdown_flag = False
    rospy.signal_shutdown(detail)


def _node_at(uri: str, name: str) -> str | None:
    rosgraph = ros("rosgraph")
    try:
        return str(rosgraph.Master(f"/{name}", master_uri=uri).lookupNode(f"/{name}"))
    except rosgraph.MasterError:
        return None


class Watch:
    """Two threads: one looks ten times a second at who is connected, one asks once a second whether the master lives.

    They are two since a master on a busy machine takes its time to answer, and who has gone is to be seen meanwhile.

    Parameters
    ----------
    look : callable
        Called at every look.
    lost : callable
        Called once, with a line of detail, when the master has gone.
    """

    def __init__(self, uri: str, look: Callable[[], None], lost: Callable[[str], None]) -> None:
        self._uri, self._look, self._lost = uri, look, lost
        self._over = Event()
        self._threads = [Thread(target=run, name="ros1", daemon=True) for run in (self._see, self._ask)]
        for thread in self._threads:
            thread.start()

    def close(self) -> None:
        """End the threads."""
        self._over.set()
        for thread in self._threads:
            thread.join()

    def _see(self) -> None:
        while not self._over.wait(LOOK):
            self._look()

    def _ask(self) -> None:
        missed = 0
        while not self._over.wait(PING):
            missed = 0 if answers(self._uri) else missed + 1
            if missed >= MISSED:
                self._lost(f"the ROS master at {self._uri} has gone")
                return
