"""The parameters of the rules of the road, with their defaults (docs/rules.md, values in <>)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from typing import Any

from dubins_traffic.errors import InputError

EDITION = 3
"""The edition of the rules of the road that is judged; docs/verdicts.md#editions says how others differed.

Norm: docs/rules.md#edition.
"""

SPARE = 0.02
"""What is left beside who may get into the way in a tick, metres (docs/rules.md#room-aside)."""
USUAL_W = 0.3
"""The half-lane width that the defaults of lengths are for, metres (docs/rules.md#scale)."""
_IN_ORDER = (
    ("left_release", "left_set", "left_release", "`left` would be cleared before it is set"),
    ("approach_distance", "queue_distance", "queue_distance", "`stopped` would be lost where it is gained"),
    ("blocked_ahead", "overtaking_ahead", "overtaking_ahead", "`overtaking` would end where it begins"),
    ("blocked_ahead", "way_distance", "way_distance", "who is `blocked` would have a free way (E5)"),
    ("stop_time", "stand_time", "stand_time", "who stops before a crossing would stand before it is excused"),
    (
        "journey_start_time",
        "rest_time",
        "journey_start_time",
        "a journey would be too long before anything excuses it (E5)",
    ),
)
"""Pairs of parameters of which the first must not be greater, which of them is to blame, and what were wrong."""
_MORE_THAN_NOTHING = {
    "approach_distance": "nobody could stop before a crossing (rule 3)",
    "enter_time": "nobody could enter a crossing in time (E3)",
    "forfeit_time": "who is first at a crossing would lose its place at once (E3)",
}
"""Parameters that must not be 0, and what were wrong."""
NO_LENGTHS = ("_time", "_rounds", "_lengths", "_share")
"""Ends of the names of fractional parameters that are no lengths, nor lengths by second."""


@dataclass(frozen=True, slots=True)
class RuleParameters:
    """Parameters of the rules by name; metres, seconds, metres per second.

    Defaults are those of roads of half-lane width 0.3 m; `for_width` gives them for others.
    A problem that asks for the rules carries all of them in `Problem.rules`.

    Raises
    ------
    InputError
        If a value is not a finite number >= 0, or not whole where a count is asked; if two contradict each other; or if
        the edition is another one.
    """

    edition: int = EDITION
    """The edition of the rules that the others are parameters of."""
    crossing_degree: int = 3
    """Least degree of a vertex that is a crossing."""
    segment_slack: float = 0.5
    """Least length of a segment beyond 2 (R + rho)."""
    sensing_slack: float = 0.5
    """The sensing radius is at least 2 (R + rho + this)."""
    still_speed: float = 0.05
    """still(d): the centre lies within still_speed * d of where it was d ago."""
    turn_back: float = 0.3
    """A lane state flips when progress has fallen this far below its maximum."""
    left_set: float = 0.05
    """left rises when the body reaches farther left of the centre line than this."""
    left_release: float = 0.0
    """left falls when the body's largest lateral coordinate is below this."""
    approach_distance: float = 0.5
    """approach: the body is at most this far from the disc."""
    stop_time: float = 0.5
    """stopped: approach and still throughout this time."""
    queue_distance: float = 0.5
    """stopped is lost farther than this from the disc."""
    group_time: float = 0.1
    """Tickets at most this much later than a group's first belong to the group."""
    forfeit_time: float = 3.0
    """Who is first at a clear crossing this long and does not enter gets a new ticket."""
    stand_time: float = 1.0
    """stands: still for this time, or lingers."""
    linger_distance: float = 0.5
    """lingers: the largest progress since the lane state was set has grown by less than this ..."""
    linger_time: float = 10.0
    """... in this last time."""
    excuse_distance: float = 1.0
    """A car this close behind one excused by the queue is excused as well."""
    blocked_ahead: float = 1.5
    """blocked: something that stands at most this far ahead."""
    blocked_gap: float = 0.1
    """blocked: less than the body's width and this much is left free of the right lane."""
    overtaking_behind: float = 0.8
    """overtaking ends when nothing that blocks lies between this far behind ..."""
    overtaking_ahead: float = 1.5
    """... and this far ahead."""
    left_time: float = 10.0
    """Rule 2: left ends within this time."""
    enter_time: float = 10.0
    """E3: who is first at a clear crossing enters within this time."""
    tickets: int = 1
    """E3: most new tickets in one wait, from the first stop in a lane state to the disc or the lane state's end."""
    exit_gap: float = 0.8
    """E4: an exit is free if no centre is in its lane within this distance of the disc; long bodies ask for more."""
    exit_time: float = 5.0
    """E4: a disc with a free exit is left within this time."""
    shared_time: float = 60.0
    """E4: so long the time does not count in which the ego is in the disc, if it came with the car or after it."""
    way_distance: float = 1.5
    """E5: the way is free if nothing narrows the lane within this distance, and no full bend is within it."""
    rest_time: float = 60.0
    """E5: what a journey may take, beside the time for its way; so long of it a full bend excuses, or, who is left, the
    ego near it."""
    journey_lengths: float = 4.0
    """E5: the time for its way is that in which a car at top speed drives so many times the longest segment."""
    journey_start_time: float = 20.0
    """E5: this time counts at the start of a journey whatever is ahead; later, time with a free way."""
    goal_time: float = 60.0
    """E6: every goal is free again within this time."""
    goal_gap: float = 0.8
    """E6: the time does not count in which the ego is this near to an exit of the goal and no exit is free."""
    exceptions: int = 0
    """Most breaches of E1 per car within exception_time."""
    exception_time: float = 60.0
    """Window over which the exceptions are counted."""
    witness_time: float = 10.0
    """A verdict says whether the culprit was within the sensing radius in this last time."""
    gap_rounds: float = 10.0
    """satisfied: no gap between visits of a goal over this many free-flow rounds."""
    gap_share: float = 0.5
    """satisfied: no gap between visits of a goal over this share of the planned duration."""
    assume_e1: int = 1
    """Whether the problem assumes E1 of the e-agents, 0 or 1; so for E2 to E6."""
    assume_e2: int = 1
    assume_e3: int = 1
    assume_e4: int = 1
    assume_e5: int = 1
    assume_e6: int = 1

    def __post_init__(self) -> None:
        if type(self.edition) is not int or self.edition != EDITION:
            raise InputError(
                "another edition of the rules of the road",
                field="edition",
                value=self.edition,
                expected=f"{EDITION}, or left out",
            )
        for field in fields(self):
            _check(field.name, getattr(self, field.name), whole=isinstance(field.default, int))
            if field.name.startswith("assume_") and getattr(self, field.name) > 1:
                value = getattr(self, field.name)
                raise InputError("not a switch", field=field.name, value=value, expected="0 or 1")
        for name, problem in _MORE_THAN_NOTHING.items():
            if getattr(self, name) == 0:
                raise InputError(problem, field=name, value=0, expected="a number > 0")
        for least, most, blamed, problem in _IN_ORDER:
            low, high = getattr(self, least), getattr(self, most)
            if low > high:
                expected = f"at least {least} ({low})" if blamed == most else f"at most {most} ({high})"
                raise InputError(problem, field=blamed, value=getattr(self, blamed), expected=expected)

    @classmethod
    def for_width(cls, w: float) -> RuleParameters:
        """Return the defaults on roads of half-lane width `w` (m): lengths, and `still_speed`, grow with it.

        Norm: docs/rules.md#scale.
        """
        scale = w / USUAL_W
        usual = cls().to_mapping()
        lengths = {
            name: value * scale
            for name, value in usual.items()
            if isinstance(value, float) and not name.endswith(NO_LENGTHS)
        }
        return cls.from_mapping(usual | lengths)

    @classmethod
    def from_mapping(cls, rules: Mapping[str, Any]) -> RuleParameters:
        """Return the parameters in `rules`, such as `Problem.rules`; those left out have their defaults.

        Raises
        ------
        InputError
            If a name is no parameter, or a value is refused as the class says.
        """
        values = tuple(rules.values())
        types = tuple(map(type, values))
        return _checked(tuple(rules), values, types) if _NUMBERS.issuperset(types) else _made(rules)

    def width_needed(self, width: float, travel: float) -> float:
        """Return how much of a right lane has to be free for a car, metres.

        The car is `width` m wide, and any point of another gets at most `travel` m in a tick.

        Norm: docs/rules.md#room-aside.
        """
        return width + max(self.blocked_gap, travel + SPARE)

    def room_beyond(self, reach: float, bodies: int) -> float:
        """Return how far beyond a disc an exit has to be empty to be free (docs/rules.md#free-exit), metres.

        `reach` (m) is a body's farthest point. In that distance there is room for `bodies` half bodies, one after
        another: 2 where nothing else may be, 3 where no other centre may be.
        """
        return max(self.exit_gap, bodies * reach + 0.25 * self.exit_gap)

    def to_mapping(self) -> dict[str, Any]:
        """Return all parameters by name, in the order of their definition."""
        return asdict(self)


_NUMBERS = frozenset((int, float))


@lru_cache(maxsize=256)
def _checked(names: tuple[str, ...], values: tuple[float, ...], _types: tuple[type, ...]) -> RuleParameters:
    """Return the parameters of these names and values; equal ones are checked once and shared."""
    return _made(dict(zip(names, values, strict=True)))


def _made(rules: Mapping[str, Any]) -> RuleParameters:
    known = {field.name for field in fields(RuleParameters)}
    for name in rules:
        if name not in known:
            raise InputError("unknown parameter of the rules", field=name, expected=f"one of {sorted(known)}")
    return RuleParameters(**rules)


def _check(name: str, value: object, *, whole: bool) -> None:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if whole and not isinstance(value, int):
        number = False
    if not number or not math.isfinite(value) or value < 0:  # pyright: ignore  # a number by then
        kind = "a whole number >= 0" if whole else "a finite number >= 0"
        raise InputError("out of range", field=name, value=value, expected=kind)
