"""The tables of the path cache and the command cache.

`policies.rules.command_cache` writes and reads them.
"""

from __future__ import annotations

from dubins_traffic.kernels.arrays import BLOCK, Floats
from dubins_traffic.kernels.records import Rows, columns, record, table

NOWHERE = 1e9
"""Longer than any way, metres: a cached command that begins so far along its way is never valid."""


@record
class KeptPath:
    """The reference path of a car, kept from tick to tick, and the labels with which one just drives on.

    All is -1 before there is a path. The path is that of `policies.rules.turn_arcs.ReferencePath`, in metres.
    """

    lane: int = -1
    """The lane in; -1: there is no path yet."""
    out: int = -1
    """The lane out."""
    crossing: int = -1
    """1 if there is a crossing between them."""
    roomy: int = -1
    """1 if the lane out is long enough for a car that has left the disc."""
    coast_chooses: int = -1
    """1 if it is in its crossing, where it may have to take another exit."""
    coast_lane: int = -1
    """The lane of its lane state."""
    coast_crosses: int = -1
    """The disc that its body meets."""
    coast_waits: int = -1
    """1 if it waits at its line, and stays where it is."""
    coast_special: int = -1
    """1 if either of the two is."""
    coast_stopped: int = -1
    """`FLAG.STOPPED` if it has, else 0."""
    coast_x: float = -1.0
    coast_y: float = -1.0
    """Where it waits."""
    length: float = -1.0
    """Of the lane in, metres."""
    out_length: float = -1.0
    """Of the lane out, metres."""
    x: float = -1.0
    y: float = -1.0
    """The intersection between them, metres."""
    tx: float = -1.0
    ty: float = -1.0
    """Direction of the lane in."""
    ux: float = -1.0
    uy: float = -1.0
    """Direction of the lane out."""
    cx: float = -1.0
    cy: float = -1.0
    """Centre of the arc, metres."""
    radius: float = -1.0
    side: float = -1.0
    """1 for an arc to the left, -1 to the right, 0 straight on."""
    middle: float = -1.0
    bend: float = -1.0
    """The curvature of the arc, 1/m."""


@columns(BLOCK)
class KeptCommands:
    """The cached commands of BLOCK cars, and the stretch of its way on which each is valid.

    `policies.rules.command_cache.check_command_caches` reads and writes these columns for several cars at once. The
    path is that of `policies.rules.turn_arcs.ReferencePath`.
    """

    low: Floats
    high: Floats
    """Where a car drives on so: between these two metres along the lane in, from the arc's centre; nowhere at first."""
    past: Floats
    """And along the lane out up to here."""
    minds: Floats
    """Along the lane in, from here on an e-agent drives on so only while the ego is not ahead in its lane."""
    astray: Floats
    """Up to how many metres left of its line it does."""
    speed: Floats
    """Its speed, m/s."""
    bend: Floats
    """The curvature of its line, 1/m."""
    x: Floats
    y: Floats
    tx: Floats
    ty: Floats
    ux: Floats
    uy: Floats
    cx: Floats
    cy: Floats
    radius: Floats
    side: Floats
    middle: Floats
    """Its path."""
    here_x: Floats
    here_y: Floats
    here_c: Floats
    here_s: Floats
    """Where it is in this frame."""
    holds: Floats
    """Whether it just drives on, as far as its pose says: 0, 1, or `command_cache.IF_NOT_BEHIND_EGO`."""
    now: Floats
    yaw_rate: Floats
    """Its command in this tick, m/s and rad/s, if it does."""


def kept_commands(trials: int, cars: int) -> Rows[KeptCommands]:
    """Return `Drivers.command` of cars of which none drives yet, (trials, blocks of cars)."""
    rows = table(KeptCommands, (trials, -(-cars // BLOCK)))
    rows["low"] = NOWHERE
    return rows
