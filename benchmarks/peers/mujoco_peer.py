"""Cars with two driven wheels and two casters in MuJoCo, on a plane. usage: mujoco_peer.py CARS SECONDS

Two steps of MuJoCo a tick are the fewest that take the cars, to within a percent, where many steps do.
"""

from __future__ import annotations

import mujoco
import numpy as np
from timing import PERIOD, RADIUS, RATE, SPEED, lattice, run, yaw_rates

SUBSTEPS = 2
WHEEL, TRACK = 0.05, 0.24
CAR = """
<body pos="{x} {y} {wheel}">
  <freejoint/>
  <geom type="cylinder" size="{radius} 0.03" pos="0 0 0.05" mass="3" friction="0.1"/>
  <geom type="sphere" size="0.03" pos="-0.12 0 -0.02" mass="0.2" condim="1" priority="1"/>
  <geom type="sphere" size="0.03" pos="0.12 0 -0.019" mass="0.2" condim="1" priority="1"/>
  <body pos="0 {half} 0"><joint name="l{n}" axis="0 1 0"/>
    <geom type="cylinder" size="{wheel} 0.01" euler="90 0 0" mass="0.3"/></body>
  <body pos="0 -{half} 0"><joint name="r{n}" axis="0 1 0"/>
    <geom type="cylinder" size="{wheel} 0.01" euler="90 0 0" mass="0.3"/></body>
</body>
"""
MODEL = """
<mujoco>
  <option timestep="{step}" integrator="implicitfast"/>
  <worldbody><geom type="plane" size="0 0 1"/>{cars}</worldbody>
  <actuator>{motors}</actuator>
</mujoco>
"""


class World:
    """One world of cars."""

    def __init__(self, cars: int) -> None:
        shared = {"wheel": WHEEL, "half": 0.5 * TRACK, "radius": RADIUS}
        bodies = [CAR.format(n=n, x=x, y=y, **shared) for n, (x, y) in enumerate(lattice(cars))]
        motors = [f'<velocity joint="{side}{n}" kv="2"/>' for n in range(cars) for side in "lr"]
        text = MODEL.format(step=PERIOD / SUBSTEPS, cars="".join(bodies), motors="".join(motors))
        self.model = mujoco.MjModel.from_xml_string(text)
        self.data = mujoco.MjData(self.model)
        yaw = np.array(yaw_rates(cars))
        self.wheels = np.stack([SPEED - 0.5 * TRACK * yaw, SPEED + 0.5 * TRACK * yaw], axis=1).ravel() / WHEEL

    def drive(self) -> int:
        """Go on for ten seconds."""
        for _ in range(10 * RATE):
            self.tick()
        return 10 * RATE * len(self.wheels) // 2

    def tick(self) -> None:
        """Set the speeds of the wheels and go on for a tick."""
        self.data.ctrl[:] = self.wheels
        mujoco.mj_step(self.model, self.data, SUBSTEPS)

    def positions(self) -> list[tuple[float, float]]:
        """Return where the cars are."""
        return [tuple(where[:2]) for where in self.data.qpos.reshape(-1, 9).tolist()]


run(mujoco.__version__, World)
