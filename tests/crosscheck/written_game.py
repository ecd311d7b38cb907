"""Solves games of cells as they are written for slugs and for tools of SYNTCOMP; run by the Python that has omega.

Each line of the standard input is a JSON list of texts, slugs' structured form or TLSF. For each one line is written,
which says of each text whether the system wins. Formulas go to omega as they stand: its parser reads
the operators of both.
"""

from __future__ import annotations

import json
import re
import sys
from typing import Any

from omega.games import gr1
from omega.symbolic import temporal

SLUGS = ("INPUT", "OUTPUT", "ENV_INIT", "SYS_INIT", "ENV_TRANS", "SYS_TRANS", "ENV_LIVENESS", "SYS_LIVENESS")
TLSF = ("INPUTS", "OUTPUTS", "INITIALLY", "PRESET", "REQUIRE", "ASSERT", "ASSUME", "GUARANTEE")


def sections(text: str) -> list[list[str]]:
    """Return inputs, outputs, and of each side what holds first, at every step, and again and again."""
    if text.startswith("INFO"):
        assert "SEMANTICS: Mealy,Strict" in text
        found = {
            name: [line.strip().removesuffix(";") for line in body.splitlines()]
            for name, body in re.findall(r"^  ([A-Z]+) \{\n(.*?)^  \}$", text, re.MULTILINE | re.DOTALL)
        }
        made = [found.get(name, []) for name in TLSF]
        again = [[re.fullmatch(r"G \(F (.*)\)", line)[1] for line in side] for side in made[6:]]
        return [*([line.replace("&&", "&").replace("||", "|") for line in part] for part in [*made[:6], *again])]
    found = {}
    for line in filter(None, text.splitlines()):
        if line.startswith("["):
            found[line.strip("[]")] = []
        else:
            found[list(found)[-1]].append(line)
    return [found[name] for name in SLUGS]


def realizable(text: str) -> bool:
    """Say whether the system wins: the environment chooses first, at the start and at every step."""
    inputs, outputs, *rest = sections(text)
    aut = temporal.Automaton()
    aut.bdd.configure(reordering=True)
    aut.declare_variables(**dict.fromkeys([*inputs, *outputs], "bool"))
    aut.varlist["env"], aut.varlist["sys"] = inputs, outputs
    aut.moore = aut.plus_one = False

    def all_of(formulas: list[str]) -> Any:
        made = aut.true
        for formula in formulas:
            made &= aut.add_expr(formula)
        return made

    env_first, sys_first, env_step, sys_step = map(all_of, rest[:4])
    aut.init["env"] = aut.init["sys"] = aut.true
    aut.action["env"], aut.action["sys"] = env_step, sys_step
    aut.win["<>[]"] = [~aut.add_expr(formula) for formula in rest[4]] or [aut.false]
    aut.win["[]<>"] = [aut.add_expr(formula) for formula in rest[5]] or [aut.true]
    aut.prime_varlists()
    won = gr1.solve_streett_game(aut)[0]
    answered = aut.exist(outputs, won & sys_first)
    return aut.forall(inputs, ~env_first | answered) == aut.true


def main() -> None:
    """Answer requests."""
    for line in sys.stdin:
        print(json.dumps([realizable(text) for text in json.loads(line)]), flush=True)


if __name__ == "__main__":
    main()
