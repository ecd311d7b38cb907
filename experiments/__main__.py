"""The experiments: `python -m experiments [--store] NAME...|--all`; without a name it lists them and what is stored.

Each runs trials until a claim of the pages is shown or refuted, for minutes or hours, on two processors. It prints its
table; the exit status is 1 if a bar is missed. With `--store` its rows are kept in `experiments/results/NAME.json`,
with the date, the commit and the machine, and docs/experiments.md is written anew, as `--page` alone does.
"""

from __future__ import annotations

import argparse
import importlib
import sys

from benchmarks.table import show

from experiments.stored import CLAIMS, load, store, write_page


def main(arguments: list[str]) -> int:
    """Run the named experiments; list them where none is named."""
    parser = argparse.ArgumentParser(prog="experiments")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(CLAIMS))
    parser.add_argument("--all", action="store_true", help="every experiment")
    parser.add_argument("--store", action="store_true", help="keep the results, and write the page anew")
    parser.add_argument("--page", action="store_true", help="write the page anew from what is stored")
    asked = parser.parse_args(arguments)
    unknown = [name for name in asked.names if name not in CLAIMS]
    if unknown:
        print(
            f"experiments: NAME: unknown: {', '.join(unknown)}; expected some of {', '.join(CLAIMS)}",
            file=sys.stderr,
        )
        return 2
    met = True
    for name in CLAIMS if asked.all else asked.names:
        rows = importlib.import_module(f"experiments.{name}").measure()
        met = show(name, rows) and met
        if asked.store:
            store(name, rows)
    if asked.store or asked.page:
        write_page()
    elif not (asked.names or asked.all):
        for name, claim in CLAIMS.items():
            found = load(name)
            print(f"{name}: {claim.says} ({claim.takes}; {'stored' if found else 'nothing stored'})")
    return 0 if met else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
