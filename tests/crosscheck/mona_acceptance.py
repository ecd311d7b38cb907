"""Acceptance of finite words by the automata that MONA makes of formulas; run by an interpreter that has ltlf2dfa.

Reads ``{"names": [...], "formulas": [[kind, formula, words], ...]}`` from the standard input: the kind is ``ltlf``
or ``pltlf`` (past only, judged at the last letter), a word a list of letters, bit i of which tells whether name i
holds. Writes for each formula whether its automaton accepts each word.
"""

from __future__ import annotations

import json
import re
import sys
import tempfile
from typing import Any


def transitions(dot: str) -> tuple[set[int], dict[int, list[tuple[str, int]]]]:
    """Return the accepting states and, by state, the guards and targets of an automaton in DOT."""
    final = re.search(r"node \[shape = doublecircle\];([^\n]*)", dot)
    accepting = {int(state) for state in re.findall(r"\d+", final[1] if final else "")}
    edges: dict[int, list[tuple[str, int]]] = {}
    for source, target, label in re.findall(r'(\d+) -> (\d+) \[label="([^"]*)"\]', dot):
        shield_filter = label.replace("~", " not ").replace("&", " and ").replace("|", " or ")
        edges.setdefault(int(source), []).append((shield_filter.replace("true", "True").strip(), int(target)))
    return accepting, edges


def accepts(dot: str, word: list[int], names: list[str]) -> bool:
    """Say whether the automaton, which begins in state 1, accepts a word."""
    accepting, edges = transitions(dot)
    state = 1
    for letter in word:
        values = {name: bool(letter >> bit & 1) for bit, name in enumerate(names)}
        targets = [target for shield_filter, target in edges.get(state, []) if eval(shield_filter, {}, values)]
        if len(targets) != 1:
            raise ValueError(f"{len(targets)} ways on from state {state}: {dot}")
        state = targets[0]
    return state in accepting


def main() -> None:
    """Answer one request."""
    from ltlf2dfa import ltlf2dfa as library
    from ltlf2dfa.parser.ltlf import LTLfParser
    from ltlf2dfa.parser.pltlf import PLTLfParser

    request = json.load(sys.stdin)
    parsers: dict[str, Any] = {"ltlf": LTLfParser(), "pltlf": PLTLfParser()}
    answers: list[list[bool]] = []
    with tempfile.TemporaryDirectory() as folder:
        library.PACKAGE_DIR = folder
        for kind, formula, words in request["formulas"]:
            dot = parsers[kind](formula).to_dfa()
            answers.append([accepts(dot, word, request["names"]) for word in words])
    sys.stdout.write("\n" + json.dumps(answers) + "\n")


if __name__ == "__main__":
    main()
