"""Keeps its lane, stops at crossings, waits for its turn, and turns in the discs of intersections.

dubins-traffic run junction --controller examples/lane_keeper.py:LaneKeeper
"""

from math import atan2

import dubins_traffic as dt

LOOK = 0.25
"""How far ahead on its line the car aims, metres."""
BEHIND = 1.0
"""Gap kept behind another car, from centre to centre, metres."""
BEYOND = 0.6
"""How far beyond an intersection the next car has to be before this one enters, metres."""


class LaneKeeper:
    """Drives round its goals by the rules of the road; waits behind what stands in its lane."""

    def start(self, problem):
        """Learn the problem; called once, before the first frame."""
        self.bounds = problem.car.bounds
        self.navigator = dt.Navigator(problem)

    def act(self, observation):
        """Choose speed (m/s) and yaw rate (rad/s) for the coming tick; called 30 times a simulated second."""
        here = self.navigator.look(observation)
        x, y, c, s = observation.pose  # (c, s) is the heading, a unit vector
        aim = here.line(LOOK)
        ahead = c * (aim.x - x) + s * (aim.y - y)
        left = c * (aim.y - y) - s * (aim.x - x)
        error = atan2(left, ahead)
        yaw_rate = max(-self.bounds.yaw_rate, min(6.0 * error, self.bounds.yaw_rate))
        speed = self.speed(observation.propositions, here) if abs(error) < 0.5 else 0.0
        return min(speed, self.bounds.speed), yaw_rate

    def speed(self, own, here):
        """Return how fast the car may go: behind the car ahead, and up to the line until it may enter."""
        speed = max(0.0, here.gap - BEHIND)
        if here.stop_line > 0.0 and not self.may_enter(own, here):
            speed = min(speed, 5.0 * max(0.0, here.stop_line - 0.1))
        return speed

    def may_enter(self, own, here):
        """Tell whether the intersection is free, and at crossings whether it is this car's turn."""
        if here.inside or here.gap < here.exit + BEYOND:
            return False
        return not here.crossing or (own.stopped and own.clear and not here.before)
