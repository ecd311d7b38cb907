"""Realizability of TLSF by Acacia-Bonsai, with Spot; run by an interpreter that has acacia_boomslang.

Standard input: a JSON list of documents of strict Mealy semantics. Standard output: for each whether the system wins
with at most `BOUND` visits to what is rejecting, so "no" may mean "not so soon".
"""

from __future__ import annotations

import json
import re
import sys

import acacia_boomslang as acacia

BOUND = 12


def all_of(formulas: list[str]) -> str:
    """Return a conjunction."""
    return " && ".join(f"({formula})" for formula in formulas) or "true"


def formula_of(found: dict[str, list[str]]) -> str:
    """Return what a document of strict semantics says, as one formula (Jacobs, Pérez and Schlehuber-Caissier, 2023)."""
    first, own, step, answer, assumed, wanted = (
        all_of(found.get(name, [])) for name in ("INITIALLY", "PRESET", "REQUIRE", "ASSERT", "ASSUME", "GUARANTEE")
    )
    steps = f"(({answer}) W !({step}))"
    return f"({first}) -> (({own}) && {steps} && ((G ({step}) && {assumed}) -> ({wanted})))"


def realizable(text: str) -> bool:
    """Say whether the system wins."""
    assert "SEMANTICS: Mealy,Strict" in text
    found = {
        name: [line.strip().removesuffix(";") for line in body.splitlines()]
        for name, body in re.findall(r"^  ([A-Z]+) \{\n(.*?)^  \}$", text, re.MULTILINE | re.DOTALL)
    }
    return wins(formula_of(found), found["INPUTS"], found["OUTPUTS"])


def wins(formula: str, inputs: list[str], outputs: list[str]) -> bool:
    """Say whether the system can keep a formula; Acacia takes its negation."""
    game = acacia.create_twa(f"!({formula})", inputs, outputs)
    acacia.preprocess_aut_standard(game, BOUND)
    acacia.set_bool_thresh_forward_saturation(game, BOUND)
    return acacia.solve_acacia_safety_game(game, BOUND, BOUND, 1).is_real()


def main() -> None:
    """Answer one request."""
    known = {"G (o <-> i)": True, "G (o <-> X i)": False, "G F i -> G F (i && o)": True, "F i": False}
    assert {formula: wins(formula, ["i"], ["o"]) for formula in known} == known
    print(json.dumps([realizable(text) for text in json.load(sys.stdin)]))


if __name__ == "__main__":
    main()
