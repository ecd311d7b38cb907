"""Checks poses in documents, with the JSON Schema of each form."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, cast

from pydantic import AfterValidator, WithJsonSchema

from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import fault


def check_start(value: object) -> object:
    """Return a start: a word, or (x, y, theta)."""
    if value in ("drawn", "origin"):
        return value
    return check_pose(value)


def _numbers(value: object) -> list[float]:
    """Return `value` as a list of finite numbers, an empty list if it is anything else."""
    row = cast("Sequence[object]", value) if isinstance(value, list | tuple) else ()
    numbers = [
        float(x) for x in row if isinstance(x, int | float) and not isinstance(x, bool) and abs(x) < 1e300
    ]
    return numbers if len(numbers) == len(row) else []


def check_pose(value: object) -> tuple[float, float, float]:
    """Return a pose (x, y, theta), metres and radians."""
    row = _numbers(value)
    if len(row) == 3 and max(abs(row[0]), abs(row[1]), abs(row[2])) <= limits.METRES:
        return row[0], row[1], row[2]
    raise fault("not a pose", f"[x, y, theta], m and rad, none above {limits.METRES:g}")


def check_heading(value: object) -> tuple[float, ...]:
    """Return a pose (x, y, theta), or (x, y, cos, sin) as it is."""
    row = _numbers(value)
    if len(row) != 4:
        return check_pose(value)
    x, y, c, s = row
    if max(abs(x), abs(y)) > limits.METRES or abs(c * c + s * s - 1.0) > 1e-6:
        raise fault("not a pose", f"[x, y, cos, sin] with a heading of length 1, at most {limits.METRES:g} m")
    return x, y, c, s


POSE_SCHEMA: dict[str, Any] = {
    "type": "array",
    "prefixItems": [{"type": "number"}] * 3,
    "minItems": 3,
    "maxItems": 3,
}
HEADING_SCHEMA: dict[str, Any] = {
    "type": "array",
    "items": {"type": "number"},
    "minItems": 3,
    "maxItems": 4,
}
GivenPose = Annotated[Any, AfterValidator(check_pose), WithJsonSchema(POSE_SCHEMA)]
GivenHeading = Annotated[Any, AfterValidator(check_heading), WithJsonSchema(HEADING_SCHEMA)]
Start = Annotated[
    Any,
    AfterValidator(check_start),
    WithJsonSchema({"anyOf": [{"enum": ["drawn", "origin"]}, POSE_SCHEMA]}),
]
