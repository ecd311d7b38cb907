"""Robustness by rtamt; run by an interpreter that has it.

Reads a list of ``{"period_ms": n, "signals": {name: [...]}, "formulas": [...]}`` from the standard input and writes for
each the value of every formula at every frame; infinities as ``Infinity``.
"""

from __future__ import annotations

import json
import sys
from typing import Any


def main() -> None:
    """Answer the requests."""
    sys.stdout.write("\n" + json.dumps([answer(request) for request in json.load(sys.stdin)]) + "\n")


def answer(request: Any) -> list[list[float]]:
    """Return the values of the formulas of one request."""
    import rtamt

    signals = request["signals"]
    frames = len(next(iter(signals.values())))
    answers: list[list[float]] = []
    for formula in request["formulas"]:
        spec = rtamt.StlDiscreteTimeSpecification()
        for name in signals:
            spec.declare_var(name, "float")
        spec.declare_var("out", "float")
        spec.set_sampling_period(request["period_ms"], "ms", 0.1)
        spec.spec = f"out = {formula}"
        spec.parse()
        data = {"time": [frame * request["period_ms"] / 1000 for frame in range(frames)]}
        answers.append([float(value) for _, value in spec.evaluate(data | signals)])
    return answers


if __name__ == "__main__":
    main()
