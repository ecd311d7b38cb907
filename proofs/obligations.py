"""All obligations, and the flaws that must not pass them."""

from __future__ import annotations

import inspect
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import ModuleType
from typing import Final

from dubins_traffic.policies import safety
from dubins_traffic.policies.rules import steering
from dubins_traffic.rules import breaches, queue, referee_kernel
from dubins_traffic.shield import checks, nearest_command
from proofs import arrival, contact, keeping, quiet
from proofs.claims import Obligation
from proofs.terms import replaced

SHIELD: Final = "design/014-shield.md#on-straight-roads"
ANY: Final = "every body, segment (straight or bent), disc and rate; roads 0.2 m wide and `turn_back` 2 cm at least"
KEEPING: Final = "theory.md#kept-in-a-tick"
STEPS: Final = ("move", "go_aside", "come_back", "fall_back", "goes_on")
"""The law's last step and what it calls, in `policies.rules.steering`."""
ANY_RATE: Final = "every rate and every bound of speed and yaw rate"

OBLIGATIONS: Final = {
    one.name: one
    for one in (
        Obligation(
            "road", "A command that the shield lets through keeps the centre on the road (1.road).", SHIELD,
            ("shield.checks.refusal", "rules.location.locate", "rules.referee_kernel._judge_car"), ANY,
            quiet.stays_on_the_road,
        ),
        Obligation(
            "lane", "It breaks neither 2.left nor 2.turn, and the car is not left in the next frame.",
            SHIELD,
            ("shield.checks._leaves_lane", "rules.location.locate", "rules.frame._label_blocked"), ANY,
            quiet.keeps_its_lane,
        ),
        Obligation(
            "crossing", "It breaks none of 3.stop, 3.order and 3.clear.", SHIELD,
            ("shield.checks._enters", "rules.location._entry_flags", "rules.breaches.judge_entry"), ANY,
            quiet.enters_on_its_turn,
        ),
        Obligation(
            "memory", "The shield remembers the greatest progress as the labeller does.", SHIELD,
            ("shield.nearest_command._remember", "rules.lane_state.keep_tops"), ANY, quiet.top_is_kept,
        ),
        Obligation(
            "reach", "No command within bounds moves a point of a car farther than `travel_of`.", SHIELD,
            ("policies.safety.moved_by", "policies.safety.travel_of"), f"discs and rectangles, {ANY_RATE}",
            contact.nobody_gets_farther,
        ),
        Obligation(
            "far", "A car for which all others are far enough away touches none, whatever they do in the tick.", SHIELD,
            ("policies.safety.keeps_clear", "policies.safety.gaps"), f"discs and rectangles, {ANY_RATE}",
            contact.nothing_is_touched,
        ),
        Obligation(
            "away", "A disc that leads away closes in on no other, whatever that does: it is at fault in no contact.",
            SHIELD, ("policies.safety.stays_ahead",), f"discs, {ANY_RATE}", contact.a_disc_leads_away,
        ),
        Obligation(
            "heading", "A way leads no farther along a heading than it is long (for `away`).", SHIELD, (), "the plane",
            contact.no_way_is_longer_along_a_heading,
        ),
        Obligation(
            "straight", "A rectangle that drives straight past another is touched at its sides or rear only.",
            SHIELD, ("policies.safety.slides_on",), f"rectangles, {ANY_RATE}", contact.a_rectangle_leads_away,
        ),
        Obligation(
            "listed", "Who is not looked at can't be touched in the tick.", SHIELD, ("shield.checks.gather_close",),
            f"discs and rectangles, {ANY_RATE}, sensing radii that reach so far", contact.nobody_near_is_overlooked,
        ),
        Obligation(
            "obstacle", "A car hits no obstacle, and ends no tick nearer to one than the next may begin.", SHIELD,
            ("policies.safety.motion_is_safe", "policies.safety.gaps"),
            "discs and rectangles, ticks in which a car gets 8 cm at most, from an eighth of that on",
            contact.no_obstacle_is_hit,
        ),
        Obligation(
            "order", "At a crossing just one car is first; nobody comes before an earlier group; and nobody waits for "
            "ever without being first, where the crossing is clear again and again.",
            "theory.md#fixed-routes-a-bound-without-a-search", ("rules.queue.keep_order", "rules.queue.rank_queue"),
            "two to four arms, any number of tickets", arrival.order_of_arrival,
        ),
        Obligation(
            "standing", "Who stands in a quiet frame breaks none of 1.road and rules 2 and 3, and the next frame is "
            "quiet: so E1 can be kept.", KEEPING,
            ("rules.location.locate", "rules.frame._label_blocked", "rules.referee_kernel._judge_car"), ANY,
            quiet.keeps_while_standing,
        ),
        Obligation(
            "driven", "With others close, the law gives a command that it has found safe, or stands (E2).", KEEPING,
            tuple(f"policies.rules.steering.{name}" for name in STEPS),
            "discs and rectangles, every way, every offset and every speed", keeping.drives_clear_or_stands,
        ),
        Obligation(
            "called", "Who must enter a crossing (E3) breaks none of 3.stop, 3.order and 3.clear by entering.", KEEPING,
            ("rules.breaches.judge_queue", "rules.breaches.judge_entry"), "any labels", keeping.may_enter_when_it_must,
        ),
    )
}  # fmt: skip
"""By name, in the order in which they are proved."""


@dataclass(frozen=True, slots=True)
class Flaw:
    """A flaw in a module of the package: in its source `right` becomes `wrong`, and an obligation must be refuted."""

    obligation: str
    module: ModuleType
    right: str
    wrong: str


FLAWS: Final = (
    Flaw("road", checks, "edge = float(roads.half_width[net]) - VERGE", "edge = float(roads.half_width[net]) + VERGE"),
    Flaw("crossing", checks, "vehicle.rounding + BRINK", "vehicle.rounding - BRINK"),
    Flaw("crossing", checks, " or lane_end(roads, net, lane) != v:", ":"),
    Flaw("crossing", checks, "if bits & FLAG.AHEAD != 0:", "if False:"),
    Flaw("crossing", checks, "bits & FLAG.CLEAR == 0 else", "bits & FLAG.STOPPED == 0 else"),
    Flaw("crossing", checks, "labels.crosses[b, EGO] == v or", "labels.crosses[b, EGO] >= 0 or"),
    Flaw("lane", checks, "    if turned:", "    if turned and fresh:"),
    Flaw("lane", checks, " else REASON.LANE", " else REASON.NOTHING"),
    Flaw("lane", checks, "reach <= vehicle.over - BRINK", "reach <= vehicle.over + BRINK"),
    Flaw("memory", nearest_command, "lane != ego.last_lane or ", ""),
    Flaw("reach", safety, "travel += car.yaw_most * car.reach * car.period", "travel += car.yaw_most * car.period"),
    Flaw("far", safety, "driven == 0.0 or least > travel + GUARD", "driven == 0.0 or least > 0.5 * travel"),
    Flaw("far", safety, "for k in range(1, 5):", "for k in range(1, 3):"),
    Flaw("away", safety, "gone = 0.25 * k * stride + (travel - stride)", "gone = 0.0"),
    Flaw("away", safety, "for k in range(5):", "for k in range(4):"),
    Flaw("away", safety, " + gone + between > 0.0", " + gone > 0.0"),
    Flaw("straight", safety, "half_extent(-pose.s, pose.c, other.c", "half_extent(pose.c, pose.s, other.c"),
    Flaw("listed", checks, "1.2 * travel_of(vehicle)", "0.8 * travel_of(vehicle)"),
    Flaw("obstacle", safety, "least > travel + GUARD or (least == gap and", "least > travel + GUARD or ("),
    Flaw("order", queue, "car.ticket <= earliest + group_ticks", "car.ticket >= earliest + group_ticks"),
    Flaw("order", queue, "        first.ticket = tick\n", ""),
    Flaw("order", queue, "        waiting -= 1\n", ""),
    Flaw("standing", referee_kernel, "far = roads.half_width[net] + GRAIN", "far = roads.half_width[net] - GRAIN"),
    Flaw("driven", steering, "    if not safe:\n        speed = 0", "    if not safe and near > 1:\n        speed = 0"),
    Flaw("driven", steering, "return on and (not outside", "return (not outside"),
    Flaw("driven", steering, "return retreat if", "return Motion(retreat.speed, 0.0, True) if"),
    Flaw("driven", steering, "safe = safe and not becomes_left", "safe = not becomes_left"),
    Flaw("called", breaches, "FIRST_AND_CLEAR == FIRST_AND_CLEAR", "FIRST_AND_CLEAR != 0"),
)  # fmt: skip


@contextmanager
def planted(flaw: Flaw) -> Iterator[None]:
    """Let a module have a flaw meanwhile; ValueError if its source has no such place, or several."""
    source = inspect.getsource(flaw.module)
    if source.count(flaw.right) != 1:
        raise ValueError(f"{flaw.module.__name__} has {source.count(flaw.right)} places {flaw.right!r}")
    wrong = compile(source.replace(flaw.right, flaw.wrong), str(flaw.module.__file__), "exec")
    with replaced(flaw.module, {}):
        exec(wrong, vars(flaw.module))  # our own source, with the flaw
        yield
