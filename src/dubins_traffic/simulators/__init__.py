"""Simulators behind the protocol `dubins_traffic.protocols.Simulator`."""
