"""Solve a game that `dubins-traffic synth ... --spec game.tlsf` has written with Spot, by its own Python module.

    path/to/the/python/that/has/spot examples/spot_solve.py game.tlsf strategy.hoa

Prints how many states the strategy has, or ends with status 1 if there is none. Strict Mealy semantics of TLSF 1.2: the
system has to keep its part only as long as the environment has kept its own (S. Jacobs, F. Klein, S. Schirmer: A
high-level LTL synthesis format, SYNT 2016, section 2.5).
"""

import re
import sys
from pathlib import Path

import spot


def formula(text):
    """Return the formula of a specification in TLSF, and the names of its outputs."""
    found = {
        name: [item.strip() for item in body.split(";") if item.strip()]
        for name, body in re.findall(r"(\w+) \{([^{}]*)\}", text[text.index("MAIN") :])
    }

    def every(name):
        return " && ".join(f"({item})" for item in found.get(name, ())) or "1"

    kept = f"({every('ASSERT')}) W !({every('REQUIRE')})"
    fair = f"(G({every('REQUIRE')}) && ({every('ASSUME')})) -> ({every('GUARANTEE')})"
    return f"({every('INITIALLY')}) -> (({every('PRESET')}) && ({kept}) && ({fair}))", found["OUTPUTS"]


def main():
    """Solve the game in a file, and write the strategy to another one."""
    source, target = sys.argv[1:]
    text, outputs = formula(Path(source).read_text(encoding="utf-8"))
    info = spot.synthesis_info()
    game = spot.ltl_to_game(spot.formula(text), outputs, info)
    if not spot.solve_game(game, info):
        sys.exit("the ego can't win")
    machine = spot.solved_game_to_separated_mealy(game, info)
    Path(target).write_text(machine.to_str("hoa") + "\n", encoding="utf-8")
    print(machine.num_states(), "states")


if __name__ == "__main__":
    main()
