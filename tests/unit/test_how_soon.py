"""How soon planted faults are found by chance is told without trying longer than the question needs."""

import json
from pathlib import Path

from experiments.falsify import Hits, at_least, code_of_searches, enough, spread


def test_the_median_is_known_to_be_above_the_cap_if_six_of_ten_were_given_up() -> None:
    evolved = [10, 20, 30, 40, 50, 70, 80, 90, 100, None]
    cap = enough(evolved, 20_000)
    assert cap == 300
    given_up = [7, 8, 9, 300, *[None] * 6]
    assert at_least(given_up, cap) > cap
    assert spread(given_up, cap) == "more than 300 (6 of 10 given up after 300; the least 7)"


def test_with_five_given_up_the_median_may_be_less_and_with_fewer_it_is_known() -> None:
    five = [1, 2, 3, 4, 100, *[None] * 5]
    assert at_least(five, 300) == (100 + 301) / 2
    four = [1, 2, 3, 4, 100, 200, *[None] * 4]
    assert at_least(four, 300) == 150
    assert spread(four, 300) == "150 (4 of 10 given up after 300; the least 1)"
    assert spread([3, 1, 2], 300) == "2 (1 to 3)"


def test_searches_are_not_run_again_for_what_is_known_of_them(tmp_path: Path) -> None:
    file = tmp_path / "rows.jsonl"
    known = {"mutant": "swerves", "strategy": "uniform", "trials": 400, "code": code_of_searches()}
    rows = [known | {"seed": 1, "hit": None}, known | {"seed": 2, "hit": 46}]
    file.write_text("".join(json.dumps(row) + "\n" for row in rows))
    hits = Hits(file)
    assert hits.first("swerves", "uniform", 1, 400) is None
    assert hits.first("swerves", "uniform", 1, 399) is None
    assert hits.first("swerves", "uniform", 2, 20_000) == 46
    assert hits.first("swerves", "uniform", 2, 45) is None
    assert len(file.read_text().splitlines()) == 2
    assert hits.first("swerves", "uniform", 3, 1) is None
    last = json.loads(file.read_text().splitlines()[-1])
    assert (last["seed"], last["trials"], last["hit"]) == (3, 1, None)
