"""Suites: what their files say, their hashes, results read and compared, games solved by us and by others."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator
from referencing import Registry, Resource
from scripts.schemas import ID, shipped

from dubins_traffic.campaign.report.statistics import estimate, share
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.suites import gather
from dubins_traffic.suites.results import compare_trials, open_sources
from dubins_traffic.suites.running import Solver, agrees, check_command, run_cases, run_games, run_suite
from dubins_traffic.suites.suite import Suite, load_suite, shipped_suites
from dubins_traffic.suites.writing import TABLE, results, write_results
from tests.suites import cases, document, games

FROZEN = {
    "adversary-2026": "a7c7766daccbd29453699c8f6d19cf0fd5c380a8409e632953a2b5abc5a3b7ba",
    "icra2016": "779b298b49a05cdbb1f444621be1f8253f8cb9d5ad46f2c60f965a9ecbcc9057",
    "rules-2026": "c3ff293646d022682c30982af0c378c459983944a31ffa6eff17f8dd1e132f56",
    "synthesis-2026": "4b812b568a64dc977afc50517fe8f944e7142e62ed60e93efa8e3623975e8c60",
    "towns-2026": "0c67e90af2d94ed41ff932a475305cf91ca10ba3c7d33c33fd81fadc481d2a08",
}
"""What is shipped changes only before version 1.0.0: then a suite that should be another gets another name."""
PROGRAM = Path(__file__).parents[2] / "examples" / "solve_game.py"


def test_shipped_suites_are_frozen() -> None:
    assert {name: load_suite(name).hash for name in shipped_suites()} == FROZEN


def test_documents_keep_to_the_schemas(tmp_path: Path) -> None:
    registry: Any = Registry().with_resources(
        [(ID + "configuration", Resource.from_contents(shipped("configuration")))]
    )
    validator = Draft202012Validator(shipped("suite", "suites"), registry=registry)
    for name in shipped_suites():
        validator.validate(load_suite(name).document)
    path = run_games(Suite.from_document(games()), tmp_path, Solver())
    Draft202012Validator(shipped("suite-result", "suites")).validate(json.loads(path.read_text()))


def test_the_hash_is_of_what_decides_problems_and_scores() -> None:
    base = Suite.from_document(document())
    campaign = document()["campaign"]
    assert Suite.from_document(document(title="Other")).hash == base.hash
    assert Suite.from_document(document(campaign={**campaign, "controllers": ["simple"]})).hash == base.hash
    for change in ({"seed": 8}, {"trials": 3}, {"factors": {"e_agents": [0, 2]}}):
        assert Suite.from_document(document(campaign={**campaign, **change})).hash != base.hash
    assert Suite.from_document(document(metric="rounds")).hash != base.hash


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"metric": "speed"}, "metric: unknown column of a score: got 'speed'"),
        ({"campaign": None}, "not one kind of suite"),
        ({"games": games()["games"]}, "not one kind of suite"),
        ({"campaign": {**document()["campaign"], "trials": None}}, "trials"),
        ({"campaign": {**document()["campaign"], "configurations": ["demo"]}}, "elsewhere, which may change"),
        ({"campaign": {**document()["campaign"], "factors": {"e_agents": [-1]}}}, "factors.e_agents"),
        ({"name": "Bad Name"}, "name"),
        ({"more": 1}, "more"),
    ],
)
def test_what_is_no_suite_is_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Suite.from_document(document(**changes), "s.json")


@pytest.mark.parametrize("change", [{"winning": 141}, {"cars": 0}, {"order_degree": 0}, {"name": "two"}])
def test_what_is_no_game_is_refused(change: dict[str, Any]) -> None:
    entries = games()["games"]
    with pytest.raises(InputError, match="games"):
        Suite.from_document(games(games=[{**entries[0], **change}, entries[1]]), "s.json")


def test_fewer_trials_are_the_first_ones() -> None:
    suite = load_suite("rules-2026")
    whole, few = suite.campaign(["simple"]), suite.campaign(["simple"], 1)
    assert [cell.seed for cell in few.cells] == [cell.seed for cell in whole.cells]
    assert (whole.total, few.total) == (160, 80)
    for count in (0, 3):
        with pytest.raises(InputError, match="trials: not a number of its trials"):
            suite.campaign(["simple"], count)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("suite") / "out"
    return run_suite(Suite.from_document(document()), folder, workers=1)


def test_a_trial_that_came_to_nothing_counts_nothing_in_the_ranking(ran: Path, tmp_path: Path) -> None:
    """Else who kills his own process where he has done badly would be ranked by the rest."""
    suite = Suite.from_document(document())
    file = json.loads(ran.read_text())
    names = [entry["controller"] for entry in file["entries"]]
    for entry, rounds in zip(file["entries"], ([9, 0, 0, 0], [3, 3, 3, 3]), strict=False):
        columns = entry["columns"]
        columns["counted_rounds"] = rounds
        if rounds[1] == 0:
            for name, values in columns.items():
                columns[name] = [values[0], *("crashed" if name == "end" else None for _ in values[1:])]
    crashing = tmp_path / ran.name
    crashing.write_text(json.dumps(file))
    table = results(suite, open_sources([str(crashing)]))[TABLE]
    assert table.index(f"| {names[1]} |") < table.index(f"| {names[0]} |")


def test_the_numbers_of_the_page_are_those_of_the_file(ran: Path) -> None:
    suite = Suite.from_document(document())
    made = results(suite, open_sources([str(ran)]))
    file = json.loads(ran.read_text())
    lines = {line.split(" | ")[0].removeprefix("| "): line.split(" | ") for line in made[TABLE].splitlines()}
    page = made["index.html"]
    assert "| time to act, mean, wall clock, ms |" in made[TABLE]
    for entry in file["entries"]:
        columns = entry["columns"]
        mean = estimate(_floats(columns["counted_rounds"]))
        clean = share(sum(columns["clean"]), len(columns["clean"]))
        assert mean.mean_interval is not None
        assert clean.share is not None
        cells = lines[entry["controller"]]
        low, high = mean.mean_interval
        assert cells[1:3] == ["4", f"{mean.mean:.4g} [{low:.4g}, {high:.4g}]"]
        assert cells[5].startswith(f"{clean.share:.1%} [")
        row = re.search(rf">{entry['controller']}</th><td data-head=\"judged\">4</td><td [^>]*>([0-9.]+%)", page)
        assert row is not None
        assert row[1] == f"{clean.share:.1%}"
        distance = estimate(_floats(columns["distance_m"]))
        assert f"{entry['controller']},distance_m,4,{distance.mean!r}," in made["controllers.csv"]
    assert suite.hash in page
    assert not re.search(r"(?:src|href)=.(?!data:)", page)


def _floats(values: list[Any]) -> Any:
    import numpy as np

    return np.array([float("nan") if value is None else float(value) for value in values])


def test_entries_of_several_files_are_one_comparison(ran: Path, tmp_path: Path) -> None:
    suite = Suite.from_document(document())
    comparison, made = compare_trials(suite, open_sources([f"ada={ran}", f"bob={ran.parent}"]))
    assert set(comparison.controllers) == {"ada rules", "ada lanes", "bob rules", "bob lanes"}
    assert made["campaign"] == suite.hash
    pairs = [one for one in comparison.differences if {one.first, one.second} == {"ada rules", "bob rules"}]
    assert {(one.larger, one.smaller) for one in pairs if not one.metric.name.endswith("_s")} == {(0, 0)}
    write_results(suite, open_sources([str(ran)]), tmp_path / "page")
    assert {path.name for path in (tmp_path / "page").iterdir()} == {
        *("index.html", "results.md"),
        *("controllers.csv", "shares.csv", "differences.csv", "factors.csv"),
    }
    with pytest.raises(InputError, match="name taken"):
        compare_trials(suite, open_sources([str(ran), str(ran)]))


def changed(ran: Path, folder: Path, **changes: Any) -> Path:
    path = folder / "other.json"
    path.write_text(json.dumps(json.loads(ran.read_text()) | changes))
    return path


def test_results_of_another_suite_are_refused(ran: Path, tmp_path: Path) -> None:
    suite = Suite.from_document(document())
    for field, value in (("hash", "0" * 64), ("trials", 1), ("suite", "other")):
        other = changed(ran, tmp_path, **{field: value})
        with pytest.raises(InputError, match=f"{field}: results of"):
            open_sources([str(ran), str(other)])
    other = changed(ran, tmp_path, hash="0" * 64)
    with pytest.raises(InputError, match="another suite than the one of that name here"):
        compare_trials(suite, open_sources([str(other)]))


def test_results_say_which_version_of_the_code_made_them(ran: Path, tmp_path: Path) -> None:
    """On the table and on the page, so that whoever reads them later knows it."""
    suite = Suite.from_document(document())
    own = json.loads(ran.read_text())
    alone = results(suite, open_sources([str(ran)]))
    assert f"\nMade by dubins-traffic {own['package']} (sources {own['code'][:12]}).\n" in alone[TABLE]
    older = changed(ran, tmp_path, package="0.1.0", code="0" * 64)
    both = results(suite, open_sources([f"ada={ran}", f"bob={older}"]))
    told = "Made by different versions of the code, in which trials may go differently: "
    assert f"{told}ada by dubins-traffic {own['package']} (sources {own['code'][:12]}); bob by" in both[TABLE]
    assert "bob by dubins-traffic 0.1.0 (sources 000000000000)." in both[TABLE]
    assert "code of bob lanes" in both["index.html"]


@pytest.mark.parametrize("kind", [cases, games])
def test_pages_of_cases_and_games_say_it_too(kind: Any, tmp_path: Path) -> None:
    suite = Suite.from_document(kind())
    if kind is cases:
        path = run_cases(suite, tmp_path / "own", ["simple"])
    else:
        path = run_games(suite, tmp_path / "own", Solver())
    older = changed(path, tmp_path, package="0.1.0", code="0" * 64)
    both = results(suite, open_sources([f"ada={path}", f"bob={older}"]))
    for made in both.values():
        assert "bob by dubins-traffic 0.1.0 (sources 000000000000)." in made


def bad_columns(entry: dict[str, Any]) -> Iterator[tuple[dict[str, Any], str]]:
    columns = entry["columns"]
    yield {name: values[:-1] for name, values in columns.items()}, "another length"
    yield (
        {name: values for name, values in columns.items() if name != "rounds"},
        "columns.rounds: a column is missing",
    )
    yield columns | {"rounds": ["x"] * 4}, "columns.rounds: a column of other values"
    yield columns | {"end": [None, *columns["end"][1:]]}, "columns.end: a column of other values"
    yield columns | {"verdict": ["won", *columns["verdict"][1:]]}, "columns.verdict: a column of other values"
    yield columns | {"rounds": [1]}, "columns of several lengths"


def test_a_suite_that_is_not_shipped_is_asked_for(
    ran: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its folder may be called as NAME=DIR is written."""
    monkeypatch.chdir(tmp_path)
    Path("rate=0.1").mkdir()
    Path("rate=0.1", ran.name).write_text(ran.read_text())
    assert main(["suite", "compare", "rate=0.1"]) == 2
    assert "results of a suite that is not shipped" in capsys.readouterr().err
    Path("mine.json").write_text(json.dumps(document()))
    assert main(["suite", "compare", "rate=0.1", "--suite", "mine.json"]) == 0
    assert "| controller |" in capsys.readouterr().out


def test_files_that_are_no_results_are_refused(ran: Path, tmp_path: Path) -> None:
    suite = Suite.from_document(document())
    entries = json.loads(ran.read_text())["entries"]
    for columns, message in bad_columns(entries[0]):
        other = changed(ran, tmp_path, entries=[{**entries[0], "columns": columns}])
        with pytest.raises(InputError, match=message):
            compare_trials(suite, open_sources([str(other)]))
    with pytest.raises(InputError, match="format"):
        open_sources([str(changed(ran, tmp_path, format="else"))])
    empty = tmp_path / "empty"
    empty.mkdir()
    with pytest.raises(InputError, match="no results of a suite"):
        open_sources([str(empty)])


def test_games_are_solved_by_us_and_by_a_program_that_reads_the_file(tmp_path: Path) -> None:
    suite = Suite.from_document(games())
    own = run_games(suite, tmp_path / "own", Solver())
    command = f"{sys.executable} {PROGRAM} {{game}}"
    check_command(command)
    other = run_games(suite, tmp_path / "other", Solver("numpy", command))
    text = results(suite, open_sources([str(own), str(other)]))[TABLE]
    assert "| dubins-traffic | dubins-traffic, s | numpy | numpy, s |" in text
    assert "dubins-traffic: 2 of 2 right" in text
    assert "numpy: 2 of 2 right" in text
    with pytest.raises(InputError, match="holds answers"):
        run_games(suite, tmp_path / "own", Solver())
    with pytest.raises(InputError, match="another suite or solver"):
        run_games(suite, tmp_path / "own", Solver("x", command), resume=True)


def test_answers_that_are_there_are_not_asked_for_again(tmp_path: Path) -> None:
    suite = Suite.from_document(games())
    program = tmp_path / "solver.py"
    log = tmp_path / "log"
    program.write_text(
        "import sys\nfrom pathlib import Path\n"
        f"log = Path({str(log)!r})\nlog.write_text(log.read_text() + 'x' if log.exists() else 'x')\n"
        'print(\'{"winning": 140, "realizable": true}\')\n'
    )
    solver = Solver("mine", f"{sys.executable} {program} {{game}}")
    path = run_games(suite, tmp_path / "out", solver)
    kept = tmp_path / "out" / "games.jsonl"
    kept.write_text("".join(kept.read_text().splitlines(keepends=True)[:2]))
    before = path.read_bytes()
    assert run_games(suite, tmp_path / "out", solver, resume=True).read_bytes() == before
    assert log.read_text() == "xxx"
    assert "mine: 1 of 2 right" in results(suite, open_sources([str(path)]))[TABLE]


@pytest.mark.parametrize(
    ("program", "seconds", "fault"),
    [
        ("print('hello')", 600.0, "no answer: printed 'hello'"),
        ("print('{\"winning\": -1}')", 600.0, "no answer"),
        ("raise SystemExit('too hard')", 600.0, "exit status 1: too hard"),
        ("import time; time.sleep(3600)", 1.0, "no answer within 1 s"),
    ],
)
def test_a_solver_without_an_answer_is_named(program: str, seconds: float, fault: str) -> None:
    entry = Suite.from_document(games()).model.games
    assert entry is not None
    found, _ = Solver(
        "x", f'{sys.executable} -c "{program}" {{game}}'.replace('{"', r"{\"").replace('":', r"\":"), seconds
    ).solve(entry[0])
    assert found.fault is not None
    assert found.fault.startswith(fault)
    assert agrees(entry[0], found) is None


def test_commands_that_are_none_are_refused() -> None:
    with pytest.raises(InputError, match="names no file of a game"):
        check_command("solver game")
    with pytest.raises(InputError, match="not a command"):
        check_command("solver 'game")
    entry = Suite.from_document(games()).model.games
    assert entry is not None
    with pytest.raises(InputError, match="can't be run"):
        Solver("x", "/nowhere/solver {game}").solve(entry[0])


def test_cases_are_run_alike_by_one_worker_and_by_two(tmp_path: Path) -> None:
    suite = Suite.from_document(cases())
    paths = [run_cases(suite, tmp_path / str(n), ["rules", "simple"], workers=n) for n in (1, 2)]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    made = results(suite, open_sources([f"ada={paths[0]}", f"bob={paths[1]}"]))
    assert "| case | ada rules | ada simple | bob rules | bob simple |" in made[TABLE]
    columns = json.loads(paths[0].read_text())["entries"][0]["columns"]
    assert f"| clean | {sum(columns['clean'])} of 3 [" in made[TABLE]
    assert made["index.html"].count("<td data-head=") >= 12
    with pytest.raises(InputError, match="holds results"):
        run_cases(suite, tmp_path / "1", ["rules", "simple"])


def test_cases_that_are_there_are_not_run_again(tmp_path: Path) -> None:
    suite = Suite.from_document(cases())
    path = run_cases(suite, tmp_path, ["simple"])
    kept = tmp_path / "cases.jsonl"
    lines = kept.read_text().splitlines(keepends=True)
    kept.write_text("".join(lines[:2]))
    told: list[tuple[int, int]] = []
    before = path.read_bytes()
    again = run_cases(suite, tmp_path, ["simple"], resume=True, progress=lambda done, total: told.append((done, total)))
    assert again.read_bytes() == before
    assert told == [(2, 3), (3, 3)]
    kept.write_text(lines[0].replace(suite.hash, "0" * 64))
    with pytest.raises(InputError, match="results of another suite"):
        run_cases(suite, tmp_path, ["simple"], resume=True)


def test_a_case_that_stands_twice_is_refused(tmp_path: Path) -> None:
    entries = cases()["cases"]
    twice = [*entries, {**entries[0], "name": "again"}]
    with pytest.raises(InputError, match="the same case twice"):
        run_cases(Suite.from_document(cases(cases=twice)), tmp_path, ["simple"])


def test_cases_that_leave_something_to_be_drawn_are_refused(tmp_path: Path) -> None:
    entries = cases()["cases"]
    del entries[1]["document"]["duration"]
    suite = Suite.from_document(cases(cases=entries))
    with pytest.raises(InputError, match=r"case-1\.duration: a case that leaves something to be drawn"):
        run_cases(suite, tmp_path, ["simple"])
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="a suite without cases"):
        run_cases(Suite.from_document(games()), tmp_path, ["simple"])


def test_a_folder_of_cases_becomes_a_suite(tmp_path: Path) -> None:
    folder = tmp_path / "cases"
    for entry, place in zip(cases()["cases"], ("lanes/3.order", "lanes/wide_group", "rules/1.road"), strict=True):
        path = folder / f"{place}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(entry["document"]))
    file = tmp_path / "suite.json"
    words = ["own-2026", "Own", str(folder), str(file)]
    gather.main(words)
    suite = load_suite(file)
    assert [entry.name for entry in suite.model.cases or ()] == [
        "lanes-3-order",
        "lanes-wide-group",
        "rules-1-road",
    ]
    assert [entry.document for entry in suite.model.cases or ()] == [entry["document"] for entry in cases()["cases"]]
    with pytest.raises(InputError, match="exists already"):
        gather.main(words)
    with pytest.raises(InputError, match="no case in it"):
        gather.gather("own", "Own", tmp_path / "nowhere")
