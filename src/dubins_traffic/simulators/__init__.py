"""Simulators, which implement `dubins_traffic.protocols.Simulator`."""
