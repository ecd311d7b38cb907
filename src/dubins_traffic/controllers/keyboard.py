"""The controller `keyboard`: a person drives the ego in real time, with the map drawn in the terminal."""

from __future__ import annotations

import atexit
import os
import sys
import termios
import tty
from math import cos, floor, pi, sin
from select import select
from time import monotonic, sleep

from dubins_traffic.cars.state import Command, Observation, Pose
from dubins_traffic.errors import InputError
from dubins_traffic.problem.instance import Problem

SPEED_STEP, YAW_STEP = 0.1, 0.3
"""Change of speed and yaw rate by one press of a key, m/s and rad/s."""
DRAWINGS = 15.0
"""Most drawings per second."""
WAKING = 0.25
"""Seconds between drawings before the first key is pressed: the window may have changed."""
MARGIN = 1.0
"""Metres shown around the network."""
ARROWS = "→↗↑↖←↙↓↘"
KEYS = {"\x1b[A": "faster", "\x1b[B": "slower", "\x1b[D": "left", "\x1b[C": "right", " ": "stop", "q": "quit"}
HELP = "up, down: speed   left, right: turn   space: stop   q: give up"
LEGEND = f"{ARROWS[0]} you   o ' another car and its front   1, 2, ... goals   · roads"
WAITING = "press a key of the last line to start"
ENTER, LEAVE = "\x1b[?1049h\x1b[?25l", "\x1b[?25h\x1b[?1049l"
"""Escape sequences: to the alternate screen without cursor, and back."""


class Keyboard:
    """Drives by keys, in real time; the map is drawn on standard error.

    Raises
    ------
    InputError
        If standard input or standard error is no terminal.
    """

    def __init__(self) -> None:
        if not (sys.stdin.isatty() and sys.stderr.isatty()):
            raise InputError(
                "needs a terminal", file="--controller", value="keyboard", expected="to be run by hand, with --jobs 1"
            )  # fmt: skip
        self._before: list[object] | None = None

    def start(self, problem: Problem) -> None:
        """Set the terminal to read single keys."""
        self._problem = problem
        self._map = Map(problem)
        self._speed = self._yaw_rate = 0.0
        self._given_up = False
        self._waits = True
        self._before = termios.tcgetattr(sys.stdin)
        atexit.register(self.close)
        tty.setcbreak(sys.stdin)
        _write(ENTER)

    def act(self, observation: Observation) -> Command | None:
        """Wait until the tick is due, read keys, draw; before the first tick wait for a first key."""
        if self._waits:
            self._wait_for_a_key(observation)
        self._next += self._problem.period
        now = monotonic()
        if self._next > now:
            sleep(self._next - now)
        else:
            self._next = now  # lost time is not caught up with
        self._press(_typed())
        if self._next - self._drawn >= 1.0 / DRAWINGS:
            self._drawn = self._next
            self._draw(observation)
        return None if self._given_up else Command(self._speed, self._yaw_rate)

    def _wait_for_a_key(self, observation: Observation) -> None:
        """Draw the map until one of the known keys is pressed; time begins then."""
        self._waits = False
        typed = ""
        while not any(key in typed for key in KEYS):
            self._draw(observation, WAITING)
            typed += _typed(WAKING)
        self._press(typed)
        self._next = self._drawn = monotonic()

    def close(self) -> None:
        """Restore the terminal's settings."""
        before, self._before = self._before, None
        if before is not None:
            _write(LEAVE)
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)  # pyright: ignore[reportArgumentType]  # as it came
            atexit.unregister(self.close)

    def _press(self, typed: str) -> None:
        bounds = self._problem.car.bounds
        while typed:
            key = next((key for key in KEYS if typed.startswith(key)), typed[0])
            typed = typed[len(key) :]
            match KEYS.get(key):
                case "faster":
                    self._speed += SPEED_STEP
                case "slower":
                    self._speed -= SPEED_STEP
                case "left":
                    self._yaw_rate += YAW_STEP
                case "right":
                    self._yaw_rate -= YAW_STEP
                case "stop":
                    self._speed = self._yaw_rate = 0.0
                case "quit":
                    self._given_up = True
                case _:
                    pass  # an unknown key
        self._speed = min(bounds.speed, max(bounds.speed_low, self._speed))
        self._yaw_rate = min(bounds.yaw_rate, max(-bounds.yaw_rate, self._yaw_rate))

    def _draw(self, observation: Observation, notice: str = "") -> None:
        columns, rows = os.get_terminal_size(sys.stderr.fileno())
        state = f"{observation.time:6.1f} s   {self._speed:+.1f} m/s   {self._yaw_rate:+.1f} rad/s"
        lines = [
            f"{state}   {notice}".rstrip()[: columns - 1],
            *self._map.draw(observation, columns - 1, rows - 4),
            LEGEND[: columns - 1],
            HELP[: columns - 1],
        ]
        _write("\x1b[H" + "".join(f"{line}\x1b[K\r\n" for line in lines))


class Map:
    """Draws roads, goals and cars as characters.

    Parameters
    ----------
    problem : Problem
        The problem with the roads and goals to draw.
    """

    def __init__(self, problem: Problem) -> None:
        self._points = problem.network.points.tolist()
        self._segments = problem.network.ends.tolist()
        self._goals = problem.goal_vertices
        xs, ys = zip(*self._points, strict=True)
        self._left, self._bottom = min(xs) - MARGIN, min(ys) - MARGIN
        self._width, self._height = max(xs) + MARGIN - self._left, max(ys) + MARGIN - self._bottom

    def draw(self, observation: Observation, columns: int, rows: int) -> list[str]:
        """Return the map as `rows` lines of `columns` characters; a character counts as twice as high as wide."""
        columns, rows = max(1, columns), max(1, rows)
        scale = min(columns / self._width, 2.0 * rows / self._height)
        cells = [[" "] * columns for _ in range(rows)]

        def put(x: float, y: float, mark: str) -> None:
            column = floor((x - self._left) * scale)
            row = rows - 1 - floor((y - self._bottom) * scale / 2.0)
            if 0 <= column < columns and 0 <= row < rows:
                cells[row][column] = mark

        for i, j in self._segments:
            (x0, y0), (x1, y1) = self._points[i], self._points[j]
            steps = max(1, floor(scale * max(abs(x1 - x0), abs(y1 - y0))))
            for k in range(steps + 1):
                put(x0 + (x1 - x0) * k / steps, y0 + (y1 - y0) * k / steps, "·")
        for vertex in dict.fromkeys(self._goals):
            x, y = self._points[vertex]
            numbers = [str(number) for number, other in enumerate(self._goals, 1) if other == vertex]
            for k, sign in enumerate("+".join(numbers)):
                put(x + k / scale, y, sign)
        for car in observation.others:
            put(car.pose.x, car.pose.y, "o")
            x, y = _ahead(car.pose, 1.5 / scale)
            put(x, y, "'")
        put(observation.pose.x, observation.pose.y, _arrow(observation.pose))
        return ["".join(row).rstrip() for row in cells]


def _arrow(pose: Pose) -> str:
    return ARROWS[floor(pose.theta / (pi / 4.0) + 0.5) % 8]


def _ahead(pose: Pose, distance: float) -> tuple[float, float]:
    return pose.x + distance * cos(pose.theta), pose.y + distance * sin(pose.theta)


def _typed(patience: float = 0.0) -> str:
    """Return what has been typed, waiting at most `patience` seconds."""
    file = sys.stdin.fileno()
    if not select([file], [], [], patience)[0]:
        return ""
    return os.read(file, 1024).decode(errors="replace")


def _write(text: str) -> None:
    sys.stderr.write(text)
    sys.stderr.flush()
