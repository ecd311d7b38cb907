"""Cars of a world that is not ours, as points with a heading, whatever carries poses and commands.

usage of its programs: FAULT NAME x y heading [NAME x y heading]...

FAULT after a second of motion: none, freeze, jump, stop.

FAULT may be DELAY,NOISE,LOST instead: commands take effect so many seconds late, poses are off by up to so many metres,
such a share of commands is lost, and poses come at 27 to 33 Hz.
"""

import collections
import math
import random
import threading
import time


class Cars:
    """The cars of the arguments of a program, moved by the wall clock."""

    def __init__(self, fault, *rows):
        self.is_disturbed = "," in fault
        self.fault = fault
        parts = fault.split(",") if self.is_disturbed else (0.0, 0.0, 0.0)
        self.delay, self.noise, self.lost = (float(part) for part in parts)
        self.names = rows[::4]
        self._dice = random.Random(1)
        self._late = collections.deque()
        self._lock = threading.Lock()
        self._cars = {
            name: [float(x), float(y), float(heading), 0.0, 0.0]
            for name, x, y, heading in zip(self.names, rows[1::4], rows[2::4], rows[3::4], strict=True)
        }
        self._moving, self._shown = 0.0, None
        self._before = time.monotonic()

    def take(self, name, speed, yaw_rate):
        with self._lock:
            if self._dice.random() >= self.lost:
                self._late.append((time.monotonic() + self.delay, name, [speed, yaw_rate]))

    def poses(self):
        """Move the cars until now; return name, x, y, z and w of each, None where no poses come any more."""
        now = time.monotonic()
        step, self._before = now - self._before, now
        with self._lock:
            while self._late and self._late[0][0] <= now:
                _, name, command = self._late.popleft()
                self._cars[name][3:] = command
            for car in self._cars.values():
                car[0] += car[3] * math.cos(car[2]) * step
                car[1] += car[3] * math.sin(car[2]) * step
                car[2] += car[4] * step
            self._moving += step * any(car[3] for car in self._cars.values())
            seen = [
                [name, x + self._off(), y + self._off(), math.sin(theta / 2), math.cos(theta / 2)]
                for name, (x, y, theta, _, _) in self._cars.items()
            ]
        late = self._moving > 1.0
        if late and self.fault == "jump":
            seen[0][1] += 5.0
        self._shown = self._shown if late and self.fault == "freeze" else seen
        return None if late and self.fault == "stop" else self._shown

    def pause(self):
        """Wait for the next poses."""
        time.sleep(1.0 / self._dice.uniform(27.0, 33.0) if self.is_disturbed else 0.01)

    def _off(self):
        return self._dice.uniform(-self.noise, self.noise)
