"""Known methods on the ranked suites: the page says what is stored, and what is stored comes again."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from experiments.baselines.failures import FILE as FAILURES
from experiments.baselines.failures import SUITE, seen_again, typical
from experiments.baselines.measuring import SHIELD, SUITES, instances_of, run, stored
from experiments.baselines.methods import METHODS
from experiments.baselines.page import DOCS, PICTURE, page
from experiments.baselines.ppo import seeds

from tests import tools

EXACT = frozenset({"simple", "lanes", "rules"})
"""Those of which each processor finds the same bits: sines of the system, products of matrices and IPOPT may differ."""
SHARE = 20
"""Of so many trials one is run again."""


def test_the_page_is_made_of_what_is_stored() -> None:
    assert (DOCS / "baselines.md").read_text(encoding="utf-8") == page()
    assert PICTURE.is_file()
    assert stored().keys() == METHODS.keys()
    for own in stored().values():
        assert own.keys() == SUITES.keys()


def test_what_each_fails_at_is_what_it_breaks_most() -> None:
    kept = json.loads(FAILURES.read_text(encoding="utf-8"))
    assert kept.keys() == METHODS.keys()
    for name, own in kept.items():
        found = typical(stored()[name][SUITE]["alone"]["columns"])
        assert found == (None if own is None else (own["rule"], own["trial"])), name


@pytest.mark.parametrize("method", sorted(EXACT - {"rules"}))
def test_the_failure_that_is_told_is_seen_again(method: str, tmp_path: Path) -> None:
    own = json.loads(FAILURES.read_text(encoding="utf-8"))[method]
    _, breach, sentence = seen_again(method, own["rule"], own["trial"], tmp_path / "it.mcap")
    assert (breach.time, sentence) == (own["time"], own["says"])


@pytest.mark.long
@pytest.mark.parametrize("suite", sorted(SUITES))
@pytest.mark.parametrize("method", [name for name, own in METHODS.items() if not own.needs])
def test_what_is_stored_of_a_method_comes_again(method: str, suite: str) -> None:
    comes_again(method, suite)


@pytest.mark.tools
@pytest.mark.parametrize("suite", sorted(SUITES))
@pytest.mark.parametrize("method", [name for name, own in METHODS.items() if own.needs])
def test_what_is_stored_of_a_method_with_a_library_comes_again(
    method: str, suite: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if METHODS[method].needs == "tulip":
        tools.interpreter_with("tulip")
    else:
        (site,) = Path(tools.interpreter_with("baselines")).parents[1].glob("lib/python*/site-packages")
        monkeypatch.setattr(sys, "path", [*sys.path, str(site)])
    comes_again(method, suite)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ppo", "shielded", "lagrangian"])
def test_what_is_told_of_the_seeds_of_ppo_is_so_of_the_median(kind: str) -> None:
    known = json.loads(seeds.FILE.read_text(encoding="utf-8"))[kind]
    assert len(known) == 3
    own = known[seeds.median(known)]
    found = seeds.of_seed(own["seed"], seeds.FILE.with_name(f"{kind}.npz"))
    for way in ("alone", "shield"):
        assert found[way] == pytest.approx(own[way], abs=0.3)


@pytest.mark.long
def test_ppo_that_has_learned_under_the_shield_makes_at_least_half_of_the_rounds_of_rules() -> None:
    """On trials of `junction` that it has not learned from: the median of three seeds, 6,000,000 steps each."""
    known = json.loads(seeds.FILE.read_text(encoding="utf-8"))
    assert seeds.measured("rules") == known["rules"]
    learned = seeds.measured(METHODS["ppo-shielded"].controller + SHIELD)["counted_rounds"]
    assert learned >= 0.5 * known["rules"]["counted_rounds"] > 0
    assert len(known["shielded"]) == 3


def comes_again(method: str, suite: str) -> None:
    """Run a twentieth of the trials again, alone and under the shield by turns."""
    instances, number = len(instances_of(suite)), list(METHODS).index(method)
    for k, way in enumerate(("alone", "shield")):
        some = list(range((number + k) % (2 * SHARE), instances, 2 * SHARE))
        if not some:
            continue
        kept = stored()[method][suite][way]["columns"]
        found, _ = run(method, suite, shield=way == "shield", some=some)
        if method in EXACT:
            assert found == {name: [values[k] for k in some] for name, values in kept.items()}
        for name in ("rounds_before_breach", "counted_rounds"):
            apart = sum(value or 0 for value in found[name]) - sum(kept[name][k] or 0 for k in some)
            assert abs(apart) <= len(some) + 1
