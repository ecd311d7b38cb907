"""The winning strategy that TuLiP finds for a trial, from where its cars start, if the game is small enough.

TuLiP, with omega and dd, gets the specification that `dubins-traffic synth --spec game.py` writes, and what it finds
drives as any [foreign strategy](../../../docs/foreign-strategies.md) does. Such a strategy knows the plays from one
start, with all cars in view: where a car was out of sight and is elsewhere, the ego goes on by the rules, under the
shield.
"""

from __future__ import annotations

import hashlib
import subprocess
from pathlib import Path
from typing import Final

from examples.foreign_synthesis import LOST, SOLVE

from dubins_traffic.errors import InputError
from dubins_traffic.files import write_text
from dubins_traffic.problem.instance import Instance
from dubins_traffic.synthesis.instance import board_of, start_cells
from dubins_traffic.synthesis.specification import specification_text

ROOT: Final = Path(__file__).resolve().parents[3]
PYTHON: Final = ROOT / "build" / "crosscheck" / "tulip" / "bin" / "python"
FOLDER: Final = ROOT / "build" / "gr1"
MOST: Final = 3_000
"""Positions of the largest game that TuLiP is asked about: it takes ten seconds for them."""
UNSOLVED: Final = "experiments.baselines.gr1.controller:GivesUp"


def controller(instance: Instance) -> str:
    """Return what drives in a trial: the file of its strategy, or what gives up at once where there is none."""
    board = board_of(instance.problem)
    if not board.others or board.positions > MOST:
        return UNSOLVED
    try:
        text = specification_text(board, start_cells(board, instance), ".py")
    except InputError:
        return UNSOLVED
    strategy = FOLDER / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.py"
    if not strategy.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        game, found = (strategy.with_suffix(ending) for ending in (".game.py", ".found.py"))
        write_text(game, text)
        words = [str(PYTHON), "-c", SOLVE, str(game), str(found)]
        done = subprocess.run(words, check=False, capture_output=True, text=True, env={"PYTHONHASHSEED": "0"})
        if done.returncode and not done.stderr.rstrip().endswith(LOST):
            raise RuntimeError(f"TuLiP: {done.stderr}")
        if done.returncode:
            write_text(found, "")
        found.replace(strategy)
    return f"{strategy}+fallback" if strategy.stat().st_size else UNSOLVED
