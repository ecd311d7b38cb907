"""From our game to a foreign tool and back on the road, in one script; docs/foreign-strategies.md tells the steps.

    python examples/foreign_synthesis.py --tulip path/to/the/python/that/has/tulip
    python examples/foreign_synthesis.py --spot path/to/the/python/that/has/spot

TuLiP, with omega and dd, is the tool, or Spot. It is run by its own Python, since it wants packages of other versions.
Prints what it has found, and the score of three minutes on the road.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

SQUARE = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": {"version": 0, "length": 6, "transform": [0, 0, 0], "shape": [2, 2]},
    "sensing_radius": 12.0,
    "laser": False,
    "e-agents": [{"type": "lawful", "name": "car"}],
    "goals": [[0, 0], [1, 1]],
    "duration": 180,
    "rules": True,
}
"""Four roads round a square; the ego is to go to two opposite corners again and again."""

LOST = "the ego can't win"
SOLVE = f"""
import runpy, sys
from tulip import dumpsmach, synth
game, strategy = sys.argv[1:]
machine = synth.synthesize(runpy.run_path(game)["specification"], solver="omega")
if machine is None:
    sys.exit("{LOST}")
dumpsmach.write_python_case(strategy, machine)
print(len(machine), "states")
"""


def command(*words: str) -> str:
    """Return what `dubins-traffic` prints."""
    return run(sys.executable, "-m", "dubins_traffic.cli", *words)


def run(*words: str) -> str:
    """Return what a program prints on its standard output; end here if it fails."""
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{' '.join(words[:3])}: {done.stderr.strip()}")
    return done.stdout


def main() -> None:
    """Write the game, have it solved, drive the strategy."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--tulip", default=sys.executable, help="the Python that has TuLiP")
    parser.add_argument("--spot", help="the Python that has Spot, which then is the tool")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        square, first = str(folder / "square.json"), str(folder / "first.json")
        Path(square).write_text(json.dumps(SQUARE))
        command("instance", square, "--seed", "1", "--full", "-o", first)
        if asked.spot:
            game, strategy = str(folder / "game.tlsf"), str(folder / "strategy.hoa")
            tool, solve = "Spot", [asked.spot, str(Path(__file__).with_name("spot_solve.py"))]
        else:
            game, strategy = str(folder / "game.py"), str(folder / "strategy.py")
            tool, solve = "TuLiP", [asked.tulip, "-c", SOLVE]
        print(command("synth", first, "--spec", game).splitlines()[0])
        print(tool, "finds a strategy of", run(*solve, game, strategy).splitlines()[-1])
        (score,) = json.loads(command("run", first, "--controller", strategy, "--json"))["trials"]
        print(f"on the road: {score['verdict']['verdict']}, {score['rounds']} rounds")


if __name__ == "__main__":
    main()
