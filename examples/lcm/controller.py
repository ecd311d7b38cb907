#!/usr/bin/env python3
"""An ego controller over LCM: round the goals in order, straight across country.

It needs the library `lcm` and the messages that lcm-gen makes of ``dubins-traffic lcm messages``. Start it beside
``dubins-traffic lcm run demo --lockstep``; it drives trial after trial until it is interrupted.
"""

import math
import os
from select import select

from lcm import LCM

from dubins_traffic.transports.lcm.dubins_traffic_lcm import command_t, instance_t, mode_t, state_t

SPEED, YAW_RATE, TOLERANCE = 0.5, 0.9, 0.1


class Controller:
    """Answers each state with one command."""

    def __init__(self):
        self.trial, self.goals, self.radius, self.next, self.tick = -1, [], 1.0, 0, -1
        self.command = command_t()
        self.lcm = LCM(os.environ.get("LCM_DEFAULT_URL", "udpm://239.255.76.67:7667?ttl=0"))
        self.lcm.subscribe("TRAFFIC_INSTANCE", self.begin)
        self.lcm.subscribe("TRAFFIC_STATE_ego", self.drive)

    def begin(self, _channel, data):
        """Learn the goals; the instance may come more than once."""
        instance = instance_t.decode(data)
        if instance.trial == self.trial:
            return
        self.trial, self.radius, self.next, self.tick = instance.trial, instance.radius, 0, -1
        self.goals = [instance.intersection[goal] for goal in instance.goal]

    def drive(self, _channel, data):
        """Turn toward the next goal, then drive to it. A state that comes again is answered as before."""
        state = state_t.decode(data)
        if state.trial != self.trial or not self.goals:
            return
        if state.tick > self.tick:
            self.tick = state.tick
            self.command = self.decide(state)
        self.lcm.publish("TRAFFIC_COMMAND_ego", self.command.encode())

    def decide(self, state):
        """Return the command that answers a state."""
        car = state.own
        gx, gy = self.goals[self.next % len(self.goals)]
        if math.hypot(gx - car.x, gy - car.y) < self.radius / 2:
            self.next += 1
        error = math.remainder(math.atan2(gy - car.y, gx - car.x) - math.atan2(car.s, car.c), 2.0 * math.pi)
        command = command_t()
        command.trial, command.tick = state.trial, state.tick
        if abs(error) > TOLERANCE:
            command.yaw_rate = math.copysign(YAW_RATE, error)
        else:
            command.speed = SPEED
        return command

    def ask(self, mode):
        """Say that this program is here (READY), or that a trial shall begin (START)."""
        request = mode_t()
        request.sender, request.mode = os.getpid(), mode
        self.lcm.publish("TRAFFIC_MODE", request.encode())


if __name__ == "__main__":
    controller = Controller()
    try:
        while True:
            if select([controller.lcm.fileno()], [], [], 0.5)[0]:
                controller.lcm.handle()
            else:  # silence: say that we are here, and that a trial may begin
                controller.ask(mode_t.READY)
                controller.ask(mode_t.START)
    except KeyboardInterrupt:
        print("interrupted")
