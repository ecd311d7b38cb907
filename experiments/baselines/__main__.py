"""Measures methods on suites, writes the record of one trial, or writes the page.

python -m experiments.baselines [METHOD...|--all] [--suites NAME,...] [--failures] [--page]
python -m experiments.baselines METHOD [--shield] --record SUITE K FILE
"""

from __future__ import annotations

import argparse

from dubins_traffic.controllers.registry import load
from dubins_traffic.runs.single import run_trial
from experiments.baselines.measuring import SHIELD, SUITES, instances_of, measure
from experiments.baselines.methods import METHODS


def main() -> int:
    """Measure the named methods, and write the page."""
    parser = argparse.ArgumentParser(prog="experiments.baselines")
    parser.add_argument("methods", nargs="*", metavar="METHOD", choices=[*METHODS, []], help=", ".join(METHODS))
    parser.add_argument("--all", action="store_true", help="every method")
    parser.add_argument("--suites", default=",".join(SUITES), metavar="NAME,...")
    parser.add_argument("--record", nargs=3, metavar=("SUITE", "K", "FILE"), help="trial K of those that are run")
    parser.add_argument("--shield", action="store_true", help="under the shield")
    parser.add_argument("--failures", action="store_true", help="find what each fails at, and draw it")
    parser.add_argument("--page", action="store_true", help="write the page from what is stored")
    asked = parser.parse_args()
    if asked.record:
        suite, trial, file = asked.record
        (method,) = asked.methods
        instance = instances_of(suite)[int(trial)]
        spec = METHODS[method].drives(instance) + (SHIELD if asked.shield else "")
        result = run_trial(instance, load(spec), name=spec, record=file)
        print(result.score.summary)
        return 0
    for method in METHODS if asked.all else asked.methods:
        measure(method, asked.suites.split(","))
    if asked.failures:
        from experiments.baselines.failures import find

        find()
    if asked.page:
        from experiments.baselines.page import write_page

        write_page()
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
