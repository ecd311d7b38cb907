"""Verdicts of LTL formulas by Spot, as it is built into Storm; run by an interpreter that has stormpy.

Reads ``{"names": [...], "formulas": [[formula, tail], ...]}`` from the standard input: a formula in Storm's syntax
and the letters that follow the first one. Writes, for every formula, the verdicts after all words of one letter and
the tail, by the first letter: as `automaton.VERDICTS` numbers them, but 1 for both undecided ones; null
where Storm stumbles over the automaton that Spot gives it.

The letters are the states of a Markov decision process in which any may follow any. So a formula can still be
satisfied after a word if the greatest probability of "the formula, and the word first" is 1 in the first letter's
state, since whoever chooses the letters may choose any infinite continuation.
"""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any


def process_text(names: list[str]) -> str:
    """Return the decision process in Storm's DRN format."""
    letters = range(1 << len(names))
    lines = ["@type: MDP", "@parameters", "", "@reward_models", "", "@nr_states", str(len(letters))]
    lines += ["@nr_choices", str(len(letters) ** 2), "@model"]
    for letter in letters:
        labels = [name for bit, name in enumerate(names) if letter >> bit & 1]
        lines.append(" ".join(["state", str(letter), *(["init"] if letter == 0 else []), *labels]))
        for target in letters:
            lines += [f"\taction {target}", f"\t\t{target} : 1"]
    return "\n".join(lines) + "\n"


def tail_text(names: list[str], tail: list[int]) -> str:
    """Return the formula that the letters of `tail` follow the first one."""
    parts: list[str] = []
    for place, letter in enumerate(tail, start=1):
        for bit, name in enumerate(names):
            literal = f'"{name}"' if letter >> bit & 1 else f'(!"{name}")'
            for _ in range(place):
                literal = f"(X {literal})"
            parts.append(literal)
    return " & ".join(parts)


def chances(stormpy: Any, model: Any, formula: str, tail: str) -> list[float]:
    """Return the greatest probability of a formula and a tail in each state."""
    text = f"({formula}) & {tail}" if tail else formula
    task = stormpy.parse_properties(f"Pmax=? [ {text} ]")[0]
    return list(stormpy.model_checking(model, task).get_value_vector())


def main() -> None:
    """Answer one request."""
    import stormpy

    request = json.load(sys.stdin)
    names = request["names"]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "letters.drn"
        file.write_text(process_text(names))
        model = stormpy.build_model_from_drn(str(file))
    answers: list[list[int] | None] = []
    for formula, tail in request["formulas"]:
        try:
            can, can_fail = (
                chances(stormpy, model, text, tail_text(names, tail)) for text in (formula, f"!({formula})")
            )
        except RuntimeError:
            answers.append(None)
            continue
        answers.append([0 if good < 0.5 else 3 if bad < 0.5 else 1 for good, bad in zip(can, can_fail, strict=True)])
    sys.stdout.write("\n" + json.dumps(answers) + "\n")


if __name__ == "__main__":
    main()
