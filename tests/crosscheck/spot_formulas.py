"""What Spot says of formulas, by its own Python module; run by an interpreter that has it.

Each line of the standard input is a request, each line written a list of its answer. ``{"read": TEXT}``: whether that
is a formula to Spot, else its complaint; ``{"same": [TEXT, TEXT]}``: whether two formulas mean the same; ``{"solve":
[TEXT, OUTPUTS]}``: a Mealy machine that realizes a formula, in HOA: what ltlsynt does, by the same library.
"""

from __future__ import annotations

import json
import sys
from typing import Any


def answer(request: dict[str, Any]) -> Any:
    """Return the answer to a request."""
    import spot

    if "read" in request:
        try:
            return bool(spot.formula(request["read"]))
        except SyntaxError as error:
            return str(error)
    if "same" in request:
        return bool(spot.are_equivalent(*map(spot.formula, request["same"])))
    info = spot.synthesis_info()
    game = spot.ltl_to_game(*request["solve"], info)
    assert spot.solve_game(game, info)
    return spot.solved_game_to_separated_mealy(game, info).to_str("hoa")


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps([answer(json.loads(line))]), flush=True)
