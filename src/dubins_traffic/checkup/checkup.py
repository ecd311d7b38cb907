"""Checks a controller: runs it twice over the course of scenarios and judges the two passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import isfinite
from typing import Any

from dubins_traffic.checkup.over_transport import run_over
from dubins_traffic.checkup.passes import Drive, Pass, run_here
from dubins_traffic.checkup.scenarios import scenarios
from dubins_traffic.controllers import registry as controllers
from dubins_traffic.protocols import End
from dubins_traffic.record.wall import summary

SLACK = 1e-9
BINS = (1e-4, 3e-4, 1e-3, 3e-3, 1e-2)
"""Edges of the histogram of latencies, seconds; the last edge is the period of a tick."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One check: its name, whether it passed, and what was observed."""

    check: str
    passed: bool
    detail: str


@dataclass(frozen=True, slots=True)
class Checkup:
    """All results; `histogram` holds (upper edge in seconds, None for all above; number of answers)."""

    controller: str
    over: str | None
    findings: tuple[Finding, ...]
    latency_s: dict[str, float]
    histogram: tuple[tuple[float | None, int], ...]
    drives: tuple[Drive, ...]

    @property
    def passed(self) -> bool:
        """Whether all checks passed."""
        return all(finding.passed for finding in self.findings)

    def to_json(self) -> dict[str, Any]:
        """Return the results as a JSON object."""
        return {
            "controller": self.controller,
            "over": self.over,
            "passed": self.passed,
            "checks": [asdict(finding) for finding in self.findings],
            "latency_s": self.latency_s,
            "histogram": [{"up_to_s": edge, "answers": count} for edge, count in self.histogram],
            "trials": [
                {
                    "name": drive.name,
                    "end": drive.end,
                    "detail": drive.detail,
                    "ticks": drive.ticks,
                    "time_to_begin_s": drive.begin_s,
                }
                for drive in self.drives
            ],
        }


def check_controller(controller: str, over: str | None = None) -> Checkup:
    """Run `controller` over the course, twice, and judge it.

    Parameters
    ----------
    controller : str
        As for `run_trial`; over a transport, the command line of a program.
    over : str, optional
        ``lcm``, ``ros1`` or ``ros2``: the transport over which the program drives.

    Raises
    ------
    InputError
        If there is no such controller.
    TransportError
        If the transport can't be opened.
    """
    if over is None:
        controllers.load(controller)
        first = run_here(controller, 1)
        second = Pass(lost=first.lost) if first.hung else run_here(controller, 2)
    else:
        first, second = run_over(over, controller)
    answers = [answer for drive in first.drives for answer in drive.answers_s]
    period = min(instance.problem.period for instance in scenarios().values())
    findings = (
        _starts(first),
        _survives(first),
        _in_time(answers, period),
        _finite(first.drives),
        _bounded(first.drives),
        _deterministic(first, second),
        _ends(first, second),
    )
    histogram = _histogram(answers, (*BINS, period))
    return Checkup(controller, over, findings, summary(answers), histogram, tuple(first.drives))


def _starts(run: Pass) -> Finding:
    slow = [drive.begin_s for drive in run.drives if drive.begin_s is not None]
    failed = [f"{drive.name}: {drive.detail}" for drive in run.drives if drive.begin_s is None]
    if not run.drives:
        failed = [run.lost]
    detail = failed[0] if failed else f"time to begin at most {max(slow):.3g} s"
    return Finding("starts", not failed, detail)


def _survives(run: Pass) -> Finding:
    failed = [f"{drive.name}: {drive.end} {drive.detail}".rstrip() for drive in run.drives if drive.end != End.DURATION]
    whole = len(scenarios())
    missing = whole - len(run.drives)
    if missing:
        failed.append(f"{missing} of {whole} trials were not run" + (f": {run.lost}" if not failed else ""))
    return Finding("survives odd instances", not failed, "; ".join(failed) or f"all {whole} to their end")


def _in_time(answers: Sequence[float], period: float) -> Finding:
    late = sum(answer > period for answer in answers)
    detail = f"{late} of {len(answers)} answers later than a tick of {period * 1e3:.3g} ms"
    return Finding("answers in time", bool(answers) and late * 100 <= len(answers), detail)


def _finite(drives: Sequence[Drive]) -> Finding:
    for drive in drives:
        for tick, command in enumerate(drive.commands):
            if not all(map(isfinite, command)):
                return Finding("finite commands", False, f"{_said(command)} at tick {tick} of {drive.name}")
    return Finding("finite commands", True, f"{sum(len(drive.commands) for drive in drives)} commands")


def _bounded(drives: Sequence[Drive]) -> Finding:
    instances = scenarios()
    for drive in drives:
        bounds = instances[drive.name].problem.car.bounds
        for tick, command in enumerate(drive.commands):
            speed, yaw_rate = command
            within = bounds.speed_low - SLACK <= speed <= bounds.speed + SLACK
            if all(map(isfinite, command)) and not (within and abs(yaw_rate) <= bounds.yaw_rate + SLACK):
                detail = f"{_said(command)} at tick {tick} of {drive.name} would be clipped"
                return Finding("commands within bounds", False, detail)
    return Finding("commands within bounds", True, "none would be clipped")


def _said(command: tuple[float, float]) -> str:
    return f"({command[0]:g} m/s, {command[1]:g} rad/s)"


def _deterministic(first: Pass, second: Pass) -> Finding:
    check = "deterministic"
    for one, other in zip(first.drives, second.drives, strict=False):
        for tick, (command, again) in enumerate(zip(one.commands, other.commands, strict=False)):
            if command != again and all(map(isfinite, (*command, *again))):
                detail = f"{command} and {again} at tick {tick} of {one.name}"
                return Finding(check, False, detail)
        if len(one.commands) != len(other.commands):
            detail = f"{len(one.commands)} and {len(other.commands)} commands in {one.name}"
            return Finding(check, False, detail)
    if len(first.drives) != len(second.drives) or not first.drives:
        return Finding(check, False, f"{len(first.drives)} and {len(second.drives)} trials in two runs")
    return Finding(check, True, "two runs, equal commands")


def _ends(*passes: Pass) -> Finding:
    wrong = [run.farewell for run in passes if run.farewell]
    wrong += [drive.detail for run in passes for drive in run.drives if "close raised" in drive.detail]
    return Finding("ends cleanly", not wrong, wrong[0] if wrong else "nothing left behind")


def _histogram(answers: Sequence[float], edges: Sequence[float]) -> tuple[tuple[float | None, int], ...]:
    rows: list[tuple[float | None, int]] = []
    below = 0
    for edge in edges:
        upto = sum(answer <= edge for answer in answers)
        rows.append((edge, upto - below))
        below = upto
    return (*rows, (None, len(answers) - below))
