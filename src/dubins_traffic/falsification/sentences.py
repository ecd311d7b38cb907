"""One sentence on a case: who did what when."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dubins_traffic.cars.state import EGO
from dubins_traffic.falsification import contract
from dubins_traffic.rules.propositions import FLAG

if TYPE_CHECKING:
    from dubins_traffic.record.reader import Record
    from dubins_traffic.scoring.score import Score
    from dubins_traffic.scoring.verdict import Violation


def sentence_of(record: Record, score: Score, breach: Violation) -> str:
    """Return who did what when in a trial in which the ego broke a rule.

    Parameters
    ----------
    record, score
        The trial, up to the breach or farther.
    breach
        The ego's.
    """
    when = f"At {breach.time:.2f} s the ego"
    match breach.rule:
        case "1.collision":
            return f"{when} {_collision(record, score, breach)}."
        case "1.road":
            return f"{when} left the road near ({breach.where.x:.1f}, {breach.where.y:.1f}) m."
        case "2.left":
            return f"{when} crossed the centre line of {_road(breach)} though nothing stood in its lane."
        case "2.return":
            since = f"as it had been since {breach.since:.2f} s"
            return f"{when} was still left of the centre line of {_road(breach)}, {since}."
        case "2.turn":
            return f"{when} turned round on {_road(breach)}."
        case rule if rule in contract.CONTRACT:
            return contract.sentence_of(score.verdict, breach)
        case "1.goal":
            since = f"since {breach.since:.2f} s" if breach.since > 0.0 else "yet"
            return f"{when} had not visited the goal {_crossing(breach)} {since}, which is longer than a gap may be."
        case rule if rule.startswith("formula "):
            place = f"({breach.where.x:.1f}, {breach.where.y:.1f}) m"
            return f"At {breach.time:.2f} s the formula became false, the ego being at {place}."
        case "3.stop" | "3.order" | "3.clear":
            return f"{when} entered the crossing at {_crossing(breach)} {_entry(record, breach)}."
        case rule:
            return f"{when} broke {rule} near ({breach.where.x:.1f}, {breach.where.y:.1f}) m."


def _collision(record: Record, score: Score, breach: Violation) -> str:
    hits = [own for own in score.collisions if abs(own.time - breach.time) <= 1.5 / record.frames.rate]
    other = hits[0].partner if hits else "something"
    place = f"at {_crossing(breach)}" if breach.where.intersection else f"on {_road(breach)}"
    speed = float(record.frames.speed[max(0, breach.tick - 1), EGO])
    how = "standing" if abs(speed) < 0.01 else f"driving at {speed:.2f} m/s"
    return f"touched {other} {place}, {how}"


def _entry(record: Record, breach: Violation) -> str:
    before = max(0, breach.tick - 1)
    bits, crosses = record.frames.bits[before], record.frames.crosses[before]
    names = record.instance.names
    if breach.rule == "3.stop":
        return "without having stopped at its line"
    vertex = _vertex(record, breach)
    if breach.rule == "3.clear":
        inside = [names[n] for n in range(1, len(names)) if crosses[n] == vertex]
        return f"while {' and '.join(inside) or 'another car'} was in it"
    waiting = [
        names[n]
        for n in range(1, len(names))
        if bits[n] & FLAG.STOPPED and _heads(record, n, before) == vertex
    ]
    return f"before its turn, while {' and '.join(waiting) or 'another car'} waited there"


def _heads(record: Record, car: int, frame: int) -> int:
    """Return the intersection at the end of a car's lane, -1 without lane state."""
    lane = int(record.frames.lane[frame, car])
    return -1 if lane < 0 else record.instance.problem.network.lane_ends(lane)[1]


def _vertex(record: Record, breach: Violation) -> int:
    where = breach.where.intersection
    return -1 if where is None else record.instance.problem.network.vertex(where)


def _crossing(breach: Violation) -> str:
    where = breach.where.intersection
    return "its place" if where is None else f"({where[0]}, {where[1]})"


def _road(breach: Violation) -> str:
    own = breach.where.segment
    return "its road" if own is None else f"the road from ({own[0]}, {own[1]}) to ({own[2]}, {own[3]})"
