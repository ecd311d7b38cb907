import pytest

from dubins_traffic.gazebo.simulator import Gazebo
from tests.conformance.simulator import SimulatorConformance
from tests.gazebo import installation

pytestmark = pytest.mark.tools


class TestGazebo(SimulatorConformance):
    """The bounds are those of docs/gazebo.md: wheels take a moment to reach a speed, contacts give way a little."""

    position = 0.03
    heading = 0.035
    touch = 0.006

    def make(self) -> Gazebo:
        installation()
        return Gazebo()
