"""The tables of the controller `lanes`: its parameters, the ego, the cars it sees, its path, and scratch."""

from __future__ import annotations

from dubins_traffic.cars.tables import ObstacleTable
from dubins_traffic.kernels.arrays import Floats
from dubins_traffic.kernels.records import Rows, record
from dubins_traffic.kernels.tables import Tables
from dubins_traffic.policies.lanes.paths import WAITING_GAP, PathRow
from dubins_traffic.policies.rules.tables import Vehicle

NOBODY = -(2**40)
"""No body: where otherwise stands a car's number, or -1 - p for obstacle part p."""


@record
class Manner:
    """The parameters of the controller's driving."""

    follow: float
    """Gap kept behind cars, centre to centre, metres."""
    near: float = 1.06
    """Within this of the ego, centre to centre, a cautious car does not move, metres."""
    clear: float = 1.2
    """So far the ego backs up from it, metres."""
    gain: float = 2.0
    """Speed falls by this much per metre of missing gap, 1/s."""
    back_speed: float = 0.3
    """Speed backwards, m/s."""
    passing_speed: float = 0.45
    """Speed past what stands, m/s."""
    stands: float = 1.0
    """A car counts as standing when it has neither moved nor turned for so long, seconds."""
    moves: float = 0.02
    """A car moves that is faster than this, m/s."""
    turns: float = 0.05
    """A car turns that turns faster than this, rad/s."""
    patience: float = 2.5
    """Seconds to wait before passing what stands."""
    retry: float = 0.5
    """Seconds between two looks for a way past."""
    despair: float = 5.0
    """Seconds to wait before asking for another route."""
    held_up: float = 0.4
    """Seconds without leave to move after which the car looks for another way."""
    progress: float = 0.3
    """Metres that the car must get on for its waits to be forgotten."""
    turn_share: float = 0.1
    """Seconds of standing that a radian of turning in place counts."""
    shuttle: int = 10
    """Ticks of each stroke of a car that has to shuttle to turn round."""
    still_margin: float = 0.05
    """Gap kept from what stands, metres."""
    moving_margin: float = 0.1
    """Gap kept from what moves, metres."""
    passing_margin: float = 0.09
    """Gap kept from what stands when a way past is chosen, metres."""
    wary_margin: float = 0.5
    """Gap kept from what moves when a way past is chosen, metres."""
    sidestep: float = 0.1
    """Offsets are tried in steps of this, metres."""
    returns: float = 0.7
    """Metres in which a car that has passed something returns to its path."""
    spacing: float = 0.1
    """Between two places at which the path ahead is looked at, metres."""
    ahead: float = 0.2
    """How far ahead on its path a car aims, metres."""
    reached: float = 0.02
    """A corner counts as reached within this, metres."""
    past_line: float = WAITING_GAP - 0.02
    """A car this far beyond a line waits for it still, metres."""


@record
class Follower:
    """The ego: pose, place on its path, manoeuvre, memory, and the command that is decided."""

    tick: int
    """The tick for which it decides."""
    x: float
    """Its centre, metres."""
    y: float
    """Its centre, metres."""
    c: float
    """Cosine of its heading."""
    s: float
    """Sine of its heading."""
    row: int
    """The row of its path that it is on."""
    loop: int
    """The row that follows the last."""
    sigma: float
    """Metres along the row."""
    left: float
    """Metres left of it."""
    odometer: float
    """Metres along the path since it was planned."""
    begin: float
    """`Manoeuvre.begin` of what it is about, metres."""
    aim: float
    """`Manoeuvre.aim`, metres."""
    ramp: float
    """`Manoeuvre.ramp`, metres."""
    until: float
    """`Manoeuvre.until`, metres."""
    since: float
    """What the odometer showed when that began, metres."""
    waited: float
    """For how long it has been kept waiting, seconds."""
    tried: float
    """For how long since it last looked for a way past, seconds."""
    stuck: float
    """For how long it has wanted to move and has not, seconds."""
    mark: float
    """What the odometer showed when it last got on, metres."""
    backs_from: int = -1
    """The car that it backs up from, or -1."""
    is_barred: int
    """1 if it has backed up, or tried to, and moves on first."""
    shuffled: int
    """Ticks of shuttling."""
    speed: float
    """What it decides, m/s."""
    yaw_rate: float
    """What it decides, rad/s."""
    blocker: int = NOBODY
    """Who has kept it waiting for too long: a new path is asked for."""


@record
class SeenCar:
    """Another car as the ego sees it."""

    x: float
    """Its centre, metres."""
    y: float
    """Its centre, metres."""
    c: float
    """Cosine of its heading."""
    s: float
    """Sine of its heading."""
    speed: float
    """m/s."""
    yaw_rate: float
    """rad/s."""
    tick: int = -1
    """The tick in which it was last seen."""


@record
class Sample:
    """A point of the path ahead."""

    x: float
    """Where it is, metres."""
    y: float
    """Where it is, metres."""
    tx: float
    """Of the unit vector along the path."""
    ty: float
    """Of the unit vector along the path."""
    low: float
    """`PathRow.low` there, metres."""
    high: float
    """`PathRow.high` there, metres."""


class Knowledge(Tables):
    """All tables of the policy for a trial.

    `path` (rows,); `other` (N,): the other cars, `still` (N,): for how long each has stood, seconds, and `gap` (N,):
    how far it is, metres; `sample` (K,): a workspace.
    """

    path: Rows[PathRow]
    follower: Follower
    vehicle: Vehicle
    manner: Manner
    other: Rows[SeenCar]
    still: Floats
    gap: Floats
    obstacles: ObstacleTable
    sample: Rows[Sample]
