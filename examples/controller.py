"""A controller of one's own: dubins-traffic run demo --controller examples/controller.py:Homing."""


class Homing:
    """Goes round its goals in order, straight across country, turning as it drives."""

    def start(self, problem):  # the time this takes is the "time to begin"
        self.goals = [problem.network.points[v] for v in problem.goal_vertices]
        self.near2 = (0.5 * problem.intersection_radius) ** 2

    def act(self, observation):
        x, y, c, s = observation.pose
        dx, dy = self.goals[0] - (x, y)
        if dx * dx + dy * dy < self.near2:
            self.goals.append(self.goals.pop(0))
        ahead, left = c * dx + s * dy, c * dy - s * dx
        return (0.0, 0.9) if ahead < abs(left) else (0.5, left)
