"""Verdicts against a semantics of our own on ultimately periodic words, and the compiled loop against a plain one."""

from __future__ import annotations

from random import Random

import numpy as np
import pytest

from dubins_traffic.logic.automaton import (
    FALSE,
    PRESUMABLY_FALSE,
    PRESUMABLY_TRUE,
    TRUE,
    Automaton,
    automaton,
)
from dubins_traffic.logic.formula import Formula, FormulaError, propositions
from dubins_traffic.logic.monitor import Monitors, parts
from dubins_traffic.logic.parse import parse
from tests.formulas import drawn, holds, holds_finite, words

NAMES = ("a", "b")
SHAPES = ((2, 2), (0, 3), (1, 3), (0, 4), (2, 3), (0, 5), (2, 4))
"""Lengths of prefix and loop of the continuations that are tried."""


def verdicts(found: Automaton, word: list[int]) -> list[int]:
    """Run a table over a word, one position after another."""
    state = 0
    clocks = [0] * len(found.clocks)
    out: list[int] = []
    for letter in word:
        valuation = sum((letter >> NAMES.index(name) & 1) << bit for bit, name in enumerate(found.names))
        place = state, int(found.letter[valuation]), sum((left == 0) << c for c, left in enumerate(clocks))
        reset = int(found.reset[place])
        clocks = [int(found.clocks[c]) - 1 if reset >> c & 1 else max(0, left - 1) for c, left in enumerate(clocks)]
        state = int(found.target[place])
        out.append(int(found.verdict[state]))
    return out


def random_formula(seed: int) -> tuple[Formula, Random]:
    random = Random(seed)
    past, bounds = seed % 2 == 1, seed % 3 == 0
    return drawn(random, random.randint(1, 4), NAMES, past=past, bounds=bounds), random


def continuations(formula: Formula, word: list[int], verdict: int) -> tuple[bool, bool]:
    """Say whether some continuation satisfies the formula, and whether some doesn't, as far as lassos show."""
    good = bad = False
    for before, around in SHAPES[:3] if verdict in (FALSE, TRUE) else SHAPES:
        tails = words(4, before + around)
        prefix = np.concatenate([np.tile(word, (len(tails), 1)), tails[:, :before]], axis=1)
        value = holds(formula, prefix, tails[:, before:], NAMES)
        good, bad = good or bool(value.any()), bad or not value.all()
        if good and bad:
            break
    return good, bad


@pytest.mark.parametrize("block", range(8))
def test_two_thousand_formulas_have_sound_and_early_verdicts(block: int) -> None:
    clocked = 0
    for seed in range(block * 250, block * 250 + 250):
        formula, random = random_formula(seed)
        word = [random.randrange(4) for _ in range(random.randint(1, 5))]
        found = verdicts(automaton(formula, 1.0, 10), word)
        good, bad = continuations(formula, word, found[-1])
        expected = {(True, False): TRUE, (False, True): FALSE}.get((good, bad))
        if expected is None:
            expected = PRESUMABLY_TRUE if holds_finite(formula, word, NAMES) else PRESUMABLY_FALSE
        assert found[-1] == expected, f"seed {seed}: {formula} after {word}"
        try:
            table = automaton(formula, 1.0, 0)
        except FormulaError:
            continue
        clocked += len(table.clocks) > 0
        assert verdicts(table, word) == found, f"seed {seed}: clocks for {formula} after {word}"
    assert clocked > 5


@pytest.mark.parametrize("seeds", [range(start, start + 20) for start in (0, 3000)], ids=["some", "others"])
def test_the_compiled_loop_runs_the_tables(seeds: range) -> None:
    formulas = {f"f{seed}": random_formula(seed)[0] for seed in seeds}
    frames = np.random.default_rng(1).integers(0, 4, size=(12, 9))
    names = ("b", "unused", "a")
    values = np.stack([frames >> 1 & 1, np.ones_like(frames), frames & 1], axis=-1)
    whole = Monitors(formulas, names, 1.0, split=False)
    whole.reset(frames.shape[1])
    for tick, frame in enumerate(values):
        found = whole.update(frame)
        for column, formula in enumerate(formulas.values()):
            table = automaton(formula, 1.0, 4)
            for trial in range(frames.shape[1]):
                assert found[trial, column] == verdicts(table, frames[: tick + 1, trial].tolist())[-1]


@pytest.mark.parametrize("start", [0, 5000])
def test_split_monitors_are_sound_and_late_only_where_parts_share_propositions(start: int) -> None:
    late = 0
    for seed in range(start, start + 60):
        formula = random_formula(seed)[0] & random_formula(seed + 700)[0]
        random = Random(seed)
        names = NAMES
        whole = Monitors({"f": formula}, names, 1.0, split=False)
        split = Monitors({"f": formula}, names, 1.0, split=True)
        default = Monitors({"f": formula}, names, 1.0)
        assert not default.late, formula
        default.reset(1)
        whole.reset(1)
        split.reset(1)
        shared = [set(propositions(part)) for part in parts(formula)]
        apart = all(not one & other for i, one in enumerate(shared) for other in shared[:i])
        for _ in range(6):
            letter = random.randrange(4)
            values = np.array([[letter & 1, letter >> 1]])
            exact, found = int(whole.update(values)[0, 0]), int(split.update(values)[0, 0])
            early = int(default.update(values)[0, 0])
            assert (early, exact) in ((PRESUMABLY_TRUE, PRESUMABLY_FALSE), (exact, exact)), formula
            if exact == FALSE and found != FALSE:
                late += 1
                assert not apart, formula
                assert found in (PRESUMABLY_FALSE, PRESUMABLY_TRUE), formula
            elif found != exact:
                assert (exact, found) == (PRESUMABLY_FALSE, PRESUMABLY_TRUE), formula
    assert late > 0


@pytest.mark.parametrize(
    "text",
    [
        "G (a -> F[5,7] b)",
        "G (a -> G[5,7] b)",
        "G (a -> (a U[5,7] b))",
        "G F[5,6] b",
        "G (!Y a | G[6,6] b)",
        "G (a & Y !a -> F[5,8] (b & X b))",
        "G ((b S a) -> !b | F[6,7] b)",
    ],
)
def test_delay_lines_judge_as_tables_that_count_everything(text: str) -> None:
    formula = parse(text)
    monitors = Monitors({"f": formula}, NAMES, 1.0)
    assert monitors.lines == 1
    exact = automaton(formula, 1.0, 10)
    random = np.random.default_rng(5)
    frames = np.where(random.random((40, 60)) < 0.15, random.integers(0, 4, (40, 60)), 2)
    monitors.reset(60)
    found = [monitors.update(np.stack([frame & 1, frame >> 1], axis=-1))[:, 0].copy() for frame in frames]
    expected = [verdicts(exact, frames[:, trial].tolist()) for trial in range(60)]
    assert np.stack(found, axis=1).tolist() == expected
    assert len(np.unique(expected)) >= 2
