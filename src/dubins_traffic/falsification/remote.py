"""An ego that a program elsewhere drives, as a search, a shrinking and a regression ask for it: over a transport."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self

from dubins_traffic.controllers import registry as controllers
from dubins_traffic.errors import InputError
from dubins_traffic.protocols import End
from dubins_traffic.record.reader import Record, read
from dubins_traffic.record.wall import remove_record
from dubins_traffic.sessions.plan import Pace, SessionPlan
from dubins_traffic.sessions.registry import TRANSPORTS
from dubins_traffic.sessions.remote import quiet
from dubins_traffic.transports.clocks import Patience

if TYPE_CHECKING:
    from dubins_traffic.problem.instance import Instance
    from dubins_traffic.runs.single import Result
    from dubins_traffic.sessions.registry import Option

WAITS: Final = ("deadline", "begin", "silence")
"""How long a driver is waited for, seconds; as the options of sessions of these names."""


@dataclass(frozen=True, slots=True)
class Reach:
    """Over which transport an ego is reached, with the options of its session, and how long it is waited for."""

    transport: str
    options: Mapping[str, Any] = field(default_factory=dict[str, Any])
    waits: Mapping[str, float] = field(default_factory=dict[str, float])

    @staticmethod
    def from_text(text: str) -> Reach:
        """Return what a text says: a transport and its options, as ``lines,port=7411``, ``ros1,master,deadline=30``."""
        name, *rest = text.split(",")
        if name not in TRANSPORTS:
            expected = f"one of {', '.join(TRANSPORTS)}, and its options"
            raise InputError("no such transport", file="--over", value=name, expected=expected)
        known = {option.flag.removeprefix("--"): option for option in TRANSPORTS[name].options}
        options: dict[str, Any] = {}
        waits: dict[str, float] = {}
        for part in rest:
            key, _, value = part.partition("=")
            if key in WAITS:
                waits[key] = _seconds(part, value)
            elif key in known:
                options[known[key].parameter] = _value(known[key], part, value)
            else:
                expected = f"of {name}: {', '.join((*known, *WAITS))}"
                raise InputError("no such option", file="--over", value=part, expected=expected)
        return Reach(name, options, waits)

    def pace(self) -> Pace:
        """Return how the driver is met: in lockstep, so that the same answers give the same trial."""
        waits = dict(self.waits)
        deadline = waits.pop("deadline", Pace().deadline)
        return Pace(lockstep=True, deadline=deadline, patience=replace(Patience(), **waits))


class Remote:
    """A session that lasts as long as it is open, and runs the trials that it is handed, one after another.

    Parameters
    ----------
    way : Reach or str
        How the program is reached.
    shield : bool
        Whether the ego drives under the shield.
    say : callable
        Is told, in lines for people, where the transport is and what it waits for, until the first trial is over.

    Attributes
    ----------
    name : str
        What records and cases call the controller.

    Raises
    ------
    InputError
        If there is no such way.

    Examples
    --------
    ::

        with Remote("lines,port=7411") as driver:
            dt.falsify("junction", driver, "found", trials=256)
    """

    def __init__(self, way: Reach | str, *, shield: bool = False, say: Callable[[str], None] = quiet) -> None:
        self._way = Reach.from_text(way) if isinstance(way, str) else way
        self._shield, self._say = shield, say
        transport = self._way.transport
        self.name = controllers.shielded(transport) if shield else transport
        self._held = ExitStack()
        self._session: Iterator[Result] | None = None
        self._next: Instance | None = None

    def __enter__(self) -> Self:
        """Return it."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close it."""
        self.close()

    def drive(self, instance: Instance) -> Record:
        """Run a trial, and return its record; TransportError if the transport is lost."""
        self._next = instance
        if self._session is None:
            self._session = self._opened()
        for result in self._session:
            assert result.record is not None
            self._say = quiet
            record = replace(read(result.record), wall=None, file=None)
            remove_record(result.record)
            if result.ending.end is not End.RESET:
                return record
        raise KeyboardInterrupt

    def close(self) -> None:
        """End the session."""
        self._session = None
        self._held.close()

    def _opened(self) -> Iterator[Result]:
        folder = Path(self._held.enter_context(tempfile.TemporaryDirectory(prefix="dubins-traffic-")))
        plan = SessionPlan(self._supply, None, None, None, (), folder, None, shield=self._shield, say=self._tell)
        entry = TRANSPORTS[self._way.transport]
        session: Any = entry.runner(plan, self._way.pace(), **self._way.options)
        self._held.callback(session.close)
        return session

    def _tell(self, line: str) -> None:
        self._say(line)

    def _supply(self, _number: int) -> Instance:
        assert self._next is not None
        return self._next


def _seconds(part: str, value: str) -> float:
    try:
        return float(value)
    except ValueError:
        raise InputError("not seconds", file="--over", value=part, expected="a number") from None


def _value(option: Option, part: str, value: str) -> bool | float | str:
    """Return the value of an option of a transport."""
    if option.kind is bool:
        if value:
            raise InputError("takes no value", file="--over", value=part, expected=part.partition("=")[0])
        return True
    if option.kind is str:
        return value
    low = -(1 << 62) if option.low is None else option.low
    high = 1 << 62 if option.high is None else option.high
    try:
        number = int(value) if option.kind is int else float(value)
    except ValueError:
        number = low - 1
    if not low <= number <= high:
        raise InputError("not a number", file="--over", value=part, expected=f"{low} to {high}")
    return number
