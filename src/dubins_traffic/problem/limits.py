"""Largest values that documents may ask for; beyond them a request is refused at once, before anything is built.

They are far above what a trial can use and low enough that no size, tick or coordinate overflows. The least values are
as far below.
"""

from __future__ import annotations

METRES = 1e6
"""Largest coordinate, length, radius, metres."""
LEAST = 1e-6
"""Smallest length, speed and yaw rate that is not 0."""
WIDTHS = (1e-3, 1e3)
"""Smallest and largest nominal width of a car, metres; random networks are drawn for these."""
SPEED = 1e3
"""Largest speed, m/s."""
RATE = 1e5
"""Largest control rate, Hz."""
SECONDS = 10_000_000
"""Longest trial, seconds (about four months)."""
TICKS = 2**31 - 1
"""Most ticks of a trial."""
TRIALS = 2**32 - 1
"""Most trials: their numbers fit 32 bits."""
SEEDS = 2**64
"""Seeds are below this."""
CARS = 10_000
"""Most e-agents of a trial, counts multiplied out."""
GOALS = 100_000
"""Most goals of an instance."""
RAYS = 100_000
"""Most rays of a laser."""
INTERSECTIONS = 100_000
"""Most intersections of a grid in a configuration, rows times columns."""
OBSTACLES = 10_000
"""Most static obstacles."""
CORNERS = 1_000
"""Most corners of one polygon."""
COMMANDS = 1_000_000
"""Most commands of a script."""
REACTION = 1_000
"""Most ticks late that an e-agent does what it asks for."""
LEGS = 10_000
"""Most legs for which something is chosen for a car."""
EXITS = 4
"""Most exits of a crossing."""
DELAY = 100_000
"""Longest command delay, ticks."""
YAW_PER_TICK = 0.5
"""Largest |omega| T, radians: the arcs' series are accurate up to it."""
