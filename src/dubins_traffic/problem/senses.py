"""What an ego senses with beside its eyes, and what disturbs it: documents that are values."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field, model_validator

from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, fault

Length = Annotated[float, Field(ge=limits.LEAST, le=limits.METRES)]
Angle = Annotated[float, Field(ge=-1e6, le=1e6)]


class Laser(Strict):
    """A laser scanner on the car's centre; the defaults are the layout of 2016."""

    rays: Annotated[int, Field(ge=1, le=limits.RAYS)] = Field(default=300, description="number of rays")
    angle_min: Angle = Field(default=-2.0, description="bearing of the first ray, rad")
    angle_max: Angle = Field(default=2.0, description="bearing of the last ray, rad")
    range_min: Annotated[float, Field(ge=0, le=limits.METRES)] = Field(
        default=0.08, description="smallest range, m"
    )
    range_max: Length = Field(default=5.0, description="largest range, m")
    rate: Annotated[float, Field(gt=0, le=limits.RATE)] = Field(default=10.0, description="scans per second")

    @model_validator(mode="after")
    def _ordered(self) -> Laser:
        if self.angle_max < self.angle_min or self.angle_max - self.angle_min > 2 * math.pi + 1e-9:
            raise fault(
                "not a field of view",
                "angle_min <= angle_max <= angle_min + 2 pi",
                "angle_max",
                self.angle_max,
            )
        if self.range_max <= self.range_min:
            raise fault(
                "not a range", f"a number > range_min = {self.range_min}", "range_max", self.range_max
            )
        return self


class Disturbances(Strict):
    """Seeded disturbances of the ego."""

    position_noise: Annotated[float, Field(ge=0, le=limits.METRES)] = Field(
        default=0.0, description="standard deviation of the observed position, m"
    )
    heading_noise: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.0, description="standard deviation of the observed heading, rad"
    )
    command_delay: Annotated[int, Field(ge=0, le=limits.DELAY)] = Field(
        default=0, description="ticks by which commands take effect late"
    )
    command_loss: Annotated[float, Field(ge=0, le=1)] = Field(
        default=0.0, description="probability that a command is lost and the last one stays in force"
    )
