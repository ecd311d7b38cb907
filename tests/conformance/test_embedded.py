from dubins_traffic.simulators.embedded import Embedded
from tests.conformance.simulator import SimulatorConformance


class TestEmbedded(SimulatorConformance):
    def make(self) -> Embedded:
        return Embedded()
