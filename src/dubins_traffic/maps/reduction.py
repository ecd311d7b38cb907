"""A road map as a road network: what it can hold, on its scale, and what was lost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.maps.choosing import Chooser
from dubins_traffic.maps.drafting import Draft, Drafter
from dubins_traffic.maps.fitting import line_of
from dubins_traffic.maps.from_rnd import network_document
from dubins_traffic.maps.losses import Losses, NothingHeldError, Outcome, Reason, losses
from dubins_traffic.maps.model import Road, RoadMap
from dubins_traffic.maps.pairs import merged
from dubins_traffic.maps.settings import ImportSettings

MOST_WORK = 300
"""Most drafts of the whole map, or so many times as many of a small part of it."""
LONGEST_ROAD, LONGEST_MAP = 1e5, 1e6
"""Most metres of a road, and of all roads of a map."""
FARTHEST = 1e6
"""Most metres of a coordinate of a network."""
WIDTH_PLAY = 0.01
"""A lane is of another width if it differs by more than this share."""


class Reduction(NamedTuple):
    """What became of a map.

    Attributes
    ----------
    document : dict
        The RND document of the network.
    losses : Losses
        What was dropped or altered.
    """

    document: dict[str, Any]
    losses: Losses


def reduction(
    road_map: RoadMap,
    settings: ImportSettings | None = None,
    file: str | None = None,
    *,
    own_lanes: bool = False,
) -> Reduction:
    """Return the road network that holds as much of a map as it can.

    Parameters
    ----------
    road_map : RoadMap
        The map.
    settings : ImportSettings, optional
        Scale, tolerance and what the network must keep.
    file : str, optional
        For messages.
    own_lanes : bool
        Whether `w` is half the usual lane of the map at the scale, instead of that of `settings`.

    Raises
    ------
    InputError
        If the map is larger than that of a town, or nothing of it can be held.
    """
    settings = settings or ImportSettings()
    if settings.scale is None and (document := network_document(road_map)) is not None:
        outcomes = [Outcome(road, (road.line,), ()) for road in road_map.roads]
        return Reduction(document, losses(outcomes, settings.tolerance, 1.0, len(outcomes), settings.w))
    _check_length(road_map.roads, file)
    if settings.pairs:
        road_map = merged(road_map, settings.pairs)
    width = usual_width(road_map.roads)
    if own_lanes:
        settings = settings.with_lanes(width)
    scale = settings.scale if settings.scale is not None else 2.0 * settings.w / width
    _check_place(road_map, scale, file)
    chooser, drafter = Chooser(road_map.roads), Drafter(road_map, settings, scale)
    dropped: dict[int, Reason] = {}
    work = MOST_WORK * len(road_map.roads)
    while work > 0 and (numbers := chooser.chosen()):
        draft = drafter.draft(numbers)
        if not draft.gone:
            return Reduction(_document(draft, scale), _lost(road_map, draft, dropped, settings, scale, width))
        dropped |= draft.gone
        chooser.drop(draft.gone)
        work -= len(numbers)
    if work <= 0:
        problem = f"too many attempts, with {len(dropped)} of {len(road_map.roads)} roads dropped so far"
        raise InputError(problem, file=file, expected="a smaller part of the map")
    raise NothingHeldError(_lost(road_map, Draft([], {}), dropped, settings, scale, width), file)


def _check_length(roads: Sequence[Road], file: str | None) -> None:
    """Raise InputError if roads are longer than those of any town."""
    lengths = [road.length for road in roads]
    longest = max(lengths)
    if longest > LONGEST_ROAD:
        field = f"road {roads[lengths.index(longest)].name}"
        expected = f"at most {LONGEST_ROAD:g} m"
        raise InputError("too long", file=file, field=field, value=round(longest), expected=expected)
    if sum(lengths) > LONGEST_MAP:
        expected = f"at most {LONGEST_MAP:g} m of roads"
        raise InputError("too large a map", file=file, value=round(sum(lengths)), expected=expected)


def _check_place(road_map: RoadMap, scale: float, file: str | None) -> None:
    """Raise InputError if a map lies farther from its origin than a network may at a scale."""
    for road in road_map.roads:
        away = float(np.abs(road.line).max())
        if scale * away > FARTHEST:
            expected = f"coordinates up to {FARTHEST / scale:g} m at this scale: move the map to its origin"
            raise InputError(
                "too far from the origin",
                file=file,
                field=f"road {road.name}",
                value=round(away),
                expected=expected,
            )


def usual_width(roads: Sequence[Road]) -> float:
    """Return the width of lanes that most of the length has."""
    lengths: dict[float, float] = {}
    for road in roads:
        if not road.closed:
            lengths[road.lane_width] = lengths.get(road.lane_width, 0.0) + road.length
    return max(lengths, key=lambda width: lengths[width]) if lengths else roads[0].lane_width


def _lost(
    road_map: RoadMap,
    draft: Draft,
    dropped: Mapping[int, Reason],
    settings: ImportSettings,
    scale: float,
    width: float,
) -> Losses:
    limits = settings.limits(scale)
    lines: dict[int, list[Floats]] = {}
    for strand, fitted in zip(draft.strands, draft.fits, strict=True):
        line = line_of(strand.line[0], fitted, strand.line[-1], limits)
        for number in strand.roads:
            lines.setdefault(number, []).append(line)
    outcomes = [
        Outcome(road, tuple(lines.get(number, ())), _reasons(road, number, dropped, width, number in lines))
        for number, road in enumerate(road_map.roads)
    ]
    return losses(outcomes, settings.tolerance, scale, len(draft.strands), settings.w)


def _reasons(road: Road, number: int, dropped: Mapping[int, Reason], width: float, held: bool) -> tuple[Reason, ...]:
    """Return why a road is altered, or dropped: what the file says of it, then what the network can't hold."""
    reasons: list[Reason] = []
    if road.closed:
        reasons.append(Reason.CLOSED)
    if not (road.forward and road.backward):
        reasons.append(Reason.ONE_WAY)
    if max(road.forward, road.backward) > 1:
        reasons.append(Reason.LANES)
    if road.pair and held:
        reasons.append(Reason.PAIR)
    if held:
        return (*reasons, Reason.WIDTH) if abs(road.lane_width - width) > WIDTH_PLAY * width else tuple(reasons)
    if number in dropped:
        return (dropped[number], *reasons)
    return tuple(reasons) or (Reason.APART,)


def _document(draft: Draft, scale: float) -> dict[str, Any]:
    """Return the RND document, version 2, whose unit is a metre."""
    rows: list[list[float]] = []
    for strand, fitted in zip(draft.strands, draft.fits, strict=True):
        ends = [scale * float(value) for value in (*strand.line[0], *strand.line[-1])]
        rows.append(ends + [scale * value for corner in fitted.corners for value in corner])
    return {"version": 2, "length": 1, "segments": rows}
