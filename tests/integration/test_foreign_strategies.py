"""Strategies of other tools: read from their files, refused when damaged, and driven on the road."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.state import Frames
from dubins_traffic.cli.main import main
from dubins_traffic.controllers import registry
from dubins_traffic.errors import InputError
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.record.reader import Record, read
from dubins_traffic.runs.single import run_trial
from dubins_traffic.synthesis.foreign.read import read_machine
from dubins_traffic.synthesis.specification import specification, specification_text
from dubins_traffic.synthesis.synthesized import STRATEGY_LEFT
from tests import foreign
from tests.games import ALL, board
from tests.grammars import slugs_sections, tlsf_sections

MACHINE = foreign.machine
FORMS = ("hoa", "aag", "aig", "slugs json", "slugs text", "tulip")


@pytest.fixture(scope="module")
def strategies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return foreign.files(tmp_path_factory.mktemp("strategies"))


@pytest.mark.path
def test_all_formats_answer_alike(strategies: dict[str, Path]) -> None:
    start_of_other = foreign.starts_of(foreign.instance())[1]
    words = [(start_of_other, *rest) for rest in product(range(4), repeat=3)]
    answers: dict[str, list[list[int | None]]] = {form: [] for form in FORMS}
    for form, word in product(FORMS, words):
        machine = read_machine(strategies[form])
        state = machine.begin()
        own: list[int | None] = []
        for cell in word:
            step = machine.step(state, {"car1_0": bool(cell & 1), "car1_1": bool(cell >> 1)})
            if step is None:
                own.append(None)
                break
            state, answer = step
            own.append(answer["ego_0"] + 2 * answer["ego_1"])
        answers[form].append(own)
    assert answers["aag"] == answers["aig"] == answers["hoa"] == answers["tulip"]
    assert answers["slugs json"] == answers["slugs text"]
    for whole, part in zip(answers["hoa"], answers["slugs json"], strict=True):
        known = part[: part.index(None)] if None in part else part
        assert whole[: len(known)] == known
        assert known


def drive(controller: str, folder: Path) -> Record:
    path = folder / f"{len(list(folder.iterdir()))}.mcap"
    run_trial(foreign.instance(), controller, record=path)
    return read(path)


def same_frames(one: Frames, other: Frames) -> bool:
    names = ("x", "y", "c", "s", "speed", "yaw_rate", "command_speed", "command_yaw_rate", "lane", "bits")
    return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in names)


def test_one_machine_drives_the_same_frames_whatever_its_format(strategies: dict[str, Path], tmp_path: Path) -> None:
    (first, *others) = (drive(str(strategies[form]), tmp_path) for form in FORMS)
    assert len(first.frames) == 1801
    for other in others:
        assert same_frames(first.frames, other.frames)
    kinds = {event.kind for block in first.blocks for event in block.events}
    assert STRATEGY_LEFT not in kinds
    assert not same_frames(first.frames, drive("rules", tmp_path).frames)


def test_the_machine_goes_round_and_keeps_the_rules(strategies: dict[str, Path]) -> None:
    score = run_trial(foreign.instance(), str(strategies["hoa"])).score
    assert score.to_json()["rounds"] == 3
    assert score.verdict is not None
    assert [one for one in score.verdict.violations if one.car == "ego"] == []


def elsewhere() -> tuple[int, dict[tuple[int, int], int]]:
    """Return a machine whose first answer is another cell than the one in which the ego starts."""
    first, steps = MACHINE()
    return (first + 1) % 4, steps


def leaping() -> tuple[int, dict[tuple[int, int], int]]:
    """Return a machine that begins well, and then leaves out a cell in every move."""
    first, steps = MACHINE()
    after = foreign.round_trip()
    return first, {(own, other): to if own == first else after[to] for (own, other), to in steps.items()}


ELSEWHERE = r"begins in cell \d, and the ego starts in cell \d"
LEAP = r"sends the ego from cell \d to cell \d, which is no move of the game"
NOTHING = r"has no answer where the cars are in cells"
NO_MOVE = [
    *((elsewhere, form, ELSEWHERE) for form in FORMS if "slugs" not in form),
    *((leaping, form, NOTHING if "slugs" in form else LEAP) for form in FORMS),
]


@pytest.mark.parametrize(("wrong", "form", "why"), NO_MOVE)
def test_who_makes_no_move_of_the_game_ends_the_trial_unless_the_rules_may_go_on(
    wrong: Any, form: str, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(foreign, "machine", wrong)
    path = foreign.files(tmp_path)[form]
    result = run_trial(foreign.instance(), str(path))
    assert result.ending.end == "controller_fault"
    assert re.search(why, result.ending.detail)
    assert result.score.verdict is not None
    assert not result.score.verdict.clean
    record = drive(f"{path}+fallback", tmp_path)
    assert len(record.frames) == 1801
    assert STRATEGY_LEFT in [event.kind for block in record.blocks for event in block.events]


CASE_SUITE: dict[str, Any] = {"version": 0, "name": "mine", "title": "One road", "metric": "counted_rounds"}


def test_commands_tell_and_store_how_much_the_strategy_decided(
    strategies: dict[str, Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("road.json").write_text(json.dumps(foreign.ROAD))
    Path("one.json").write_text(json.dumps(instance_to_document(foreign.instance())))
    good = strategies["hoa"]
    monkeypatch.setattr(foreign, "machine", elsewhere)
    Path("bad").mkdir()
    bad = f"{foreign.files(Path('bad'))['hoa']}+fallback"
    for spec, share in ((str(good), 1.0), (bad, 0.0)):
        assert main(["run", "one.json", "--controller", spec, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["trials"][0]["metrics"] == {"strategy_share": share}
        assert main(["batch", "road.json", "--controller", spec, "--trials", "1", "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["trials"][0]["metrics"] == {"strategy_share": share}
    assert main(["run", "one.json", "--controller", bad]) == 0
    assert " 0.0%" in capsys.readouterr().out
    document = instance_to_document(foreign.instance())
    cases = {**CASE_SUITE, "cases": [{"name": "one", "document": document}]}
    trials = {"name": "road", "document": foreign.ROAD}
    own = {"version": 0, "seed": 5, "trials": 1, "controllers": ["rules"], "configurations": [trials]}
    for name, suite in (("cases", cases), ("trials", {**CASE_SUITE, "campaign": own})):
        Path(f"{name}.json").write_text(json.dumps(suite))
        arguments = ["suite", "run", f"{name}.json", "--workers", "1", "-o", f"out-{name}"]
        assert main([*arguments, "--controller", bad, "--controller", "rules"]) == 0
        out = capsys.readouterr().out
        assert f"{Path(bad).name}: the strategy made 0.0% of the decisions" in out
        assert "rules: the strategy" not in out
        file = next(path for path in Path(f"out-{name}").glob("mine-*.json") if ".wall." not in path.name)
        first, second = json.loads(file.read_text())["entries"]
        assert first["columns"]["strategy_share"] == [0.0]
        assert "strategy_share" not in second["columns"]
        compare = ["suite", "compare", "--suite", f"{name}.json", f"ours={file}"]
        assert main(compare) == 0
        out = capsys.readouterr().out
        assert f"\nours {Path(bad).name}: the strategy made 0.0% of the decisions.\n" in out
        assert "rules: the strategy" not in out
        for wrong in ("half", 2.0):
            document = json.loads(file.read_text())
            document["entries"][0]["columns"]["strategy_share"] = [wrong]
            file.write_text(json.dumps(document))
            assert main(compare) == 2
            assert f"columns.strategy_share: not a share: got {wrong!r}" in capsys.readouterr().err


def swapped(text: str) -> str:
    for one, other in (("ego_", "x_"), ("car1_", "ego_"), ("x_", "car1_")):
        text = text.replace(one, other)
    return text


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (
            foreign.as_hoa().replace("controllable-AP: 2 3", "controllable-AP: 0 1"),
            "reads what the ego chooses",
        ),
        (
            foreign.as_hoa().replace("controllable-AP: 2 3", "controllable-AP: 2"),
            "reads what the ego chooses",
        ),
        (
            foreign.as_hoa().replace("controllable-AP: 2 3", "controllable-AP: 0 2 3"),
            "chooses for the others",
        ),
        (swapped(foreign.as_hoa()), "reads what the ego chooses"),
        (swapped(foreign.as_aag()), "reads what the ego chooses"),
        (swapped(foreign.as_tulip()), "reads what the ego chooses"),
    ],
)
def test_a_machine_with_another_split_of_the_players_is_refused(made: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / ("swapped.py" if made.startswith("class") else "swapped")
    path.write_text(made)
    for spec in (str(path), f"{path}+fallback"):
        with pytest.raises(InputError, match=f"a strategy that {message}"):
            registry.load(spec).start(foreign.instance().problem)
    assert run_trial(foreign.instance(), str(path)).ending.end == "controller_fault"


def test_a_machine_that_does_not_say_what_it_reads_is_found_out_when_it_answers(tmp_path: Path) -> None:
    path = tmp_path / "swapped"
    path.write_text(swapped(foreign.as_hoa()).replace("controllable-AP: 2 3\n", ""))
    result = run_trial(foreign.instance(), str(path))
    assert result.ending.end == "controller_fault"
    assert "+fallback" in result.ending.detail


@pytest.mark.parametrize("given", ["0 9", "0\ncontrollable-AP: 1", "x"])
def test_a_split_of_players_that_is_none_is_refused(given: str, tmp_path: Path) -> None:
    path = tmp_path / "strategy"
    path.write_text(foreign.as_hoa().replace("controllable-AP: 2 3", f"controllable-AP: {given}"))
    with pytest.raises(InputError, match=r"controllable-AP|no state's number"):
        registry.load(str(path))


def test_only_a_strategy_of_another_tool_has_a_fallback(tmp_path: Path) -> None:
    for spec in ("rules+fallback", "synthesized+fallback", str(tmp_path / "none.hoa+fallback")):
        with pytest.raises(InputError, match="unknown controller"):
            registry.load(spec)


def test_a_machine_for_another_problem_is_refused(strategies: dict[str, Path], tmp_path: Path) -> None:
    some = foreign.instance()
    controller = registry.load(str(strategies["hoa"]))
    two = replace(some.problem, e_agents=("a", "b"))
    controller.start(two)  # its propositions are some of those of the larger game
    path = tmp_path / "strange"
    path.write_text(foreign.as_hoa().replace('"car1_1"', '"weather"'))
    with pytest.raises(InputError, match="weather: a strategy for another problem"):
        registry.load(str(path)).start(some.problem)
    path.write_text(foreign.as_hoa().replace('"ego_1"', '"first_0_1"'))
    with pytest.raises(InputError, match="ego_1: a strategy for another problem"):
        registry.load(str(path)).start(some.problem)


def damaged() -> list[tuple[str, str | bytes, str]]:
    hoa, aag, text = foreign.as_hoa(), foreign.as_aag(), foreign.as_slugs_text()
    return [
        ("nothing known", "hello", "no strategy that is known"),
        ("binary", b"\xff\xfe\x00", "not UTF-8"),
        ("hoa without body", hoa.partition("--BODY--")[0], "--BODY-- or --END-- is missing"),
        ("hoa without end", hoa.partition("--END--")[0], "--BODY-- or --END-- is missing"),
        ("hoa of other names", hoa.replace("AP: 4", "AP: 5"), "another number of names"),
        ("hoa with a label of state", hoa.replace("State: 0", "State: [0] 0"), "no state's number"),
        ("hoa with an unknown number", hoa.replace("[!0&", "[!9&", 1), "not a label"),
        ("hoa with an open label", hoa.replace("] 0", " 0", 1), "label"),
        ("hoa without its start", hoa.replace("Start: 0", "Start: 7"), "in which it starts is missing"),
        ("aiger cut off", aag[:60], "cut off"),
        ("aiger with a bad header", aag.replace("aag ", "aag x", 1), "not a header"),
        ("aiger too large", "aag 999999999 0 0 0 0\n", "too large a circuit"),
        (
            "aiger with unknown literals",
            aag.replace("\n2\n4\n", "\n2\n444\n"),
            "a literal of no variable|nothing",
        ),
        ("slugs of other names", text.replace("ego_0:1", "ego_9:1"), "a state of other propositions"),
        ("slugs with an unknown successor", text.replace("successors : 0", "successors : 99"), "no state"),
        ("json that is none", "{", "not JSON"),
        ("json of something else", "{}", "variables and nodes"),
        ("tulip's, changed", foreign.as_tulip().replace("self.state == 0", "self.state > 0"), "dumpsmach"),
    ]


@pytest.mark.parametrize(("data", "message"), [case[1:] for case in damaged()], ids=[case[0] for case in damaged()])
@pytest.mark.path
def test_damaged_files_are_refused(data: str | bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "strategy"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    with pytest.raises(InputError, match=message):
        registry.load(str(path))


def test_labels_of_hoa_are_read_as_they_are_meant(tmp_path: Path) -> None:
    path = tmp_path / "strategy"
    path.write_text(
        'HOA: v1\nStart: 0\nAP: 3 "a" "b" "ego_0"\nAcceptance: 0 t\n--BODY--\nState: 0\n'
        "[(0&!1 | !0&1) & 2] 1\n[!(0&!1 | !0&1) & !2] 0 {1}\nState: 1\n/* for ever */ [t] 1\n--END--\n"
    )
    machine = read_machine(path)
    for a, b in product((False, True), repeat=2):
        found = machine.step(0, {"a": a, "b": b})
        assert found == (int(a != b), {"ego_0": a != b})


@pytest.mark.parametrize(("some", "cells"), [(board(2, 2, 1), [0, 5]), (board(2, 2, 2, ALL, 3), [0, 9, 11])])
def test_specifications_keep_to_their_grammars(some: Any, cells: list[int]) -> None:
    tlsf = tlsf_sections(specification_text(some, cells, ".tlsf"))
    slugs = slugs_sections(specification_text(some, cells, ".structuredslugs"))
    spec = specification(some, cells)
    assert tlsf["inputs"] == slugs["INPUT"] == list(spec.inputs)
    assert tlsf["outputs"] == slugs["OUTPUT"] == list(spec.outputs)
    assert len(slugs["SYS_LIVENESS"]) == len(some.road_cells.targets)


@pytest.mark.parametrize(
    ("some", "cells", "message"),
    [
        (board(2, 2, 1, "E1,E3,E4,E5,E6"), [0, 5], "without E2"),
        (board(2, 2, 1, "E1,E2,E3:forfeits,E4,E5,E6"), [0, 5], "without E3"),
        (board(2, 2, 1, "E1,E2,E3,E4,E6"), [0, 5], "without E5"),
        (board(3, 3, 1, ALL, 4), [0, 5], "order_degree"),
        (board(2, 2, 5), [0, 1, 2, 3, 4, 5], "too many e-agents"),
        (board(2, 2, 1), [5, 5], "not starts of the game"),
    ],
)
def test_games_that_can_not_be_said_are_refused(some: Any, cells: list[int], message: str) -> None:
    with pytest.raises(InputError, match=message):
        specification(some, cells)


def test_the_command_writes_specifications(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "road.json"
    file.write_text(json.dumps(instance_to_document(foreign.instance())))
    for ending in ("structuredslugs", "tlsf", "py"):
        target = tmp_path / f"game.{ending}"
        assert main(["synth", str(file), "--spec", str(target)]) == 0
        assert "car1_0" in target.read_text()
    assert main(["synth", str(file), "--spec", str(tmp_path / "game.tlsf")]) == 2
    assert main(["synth", str(file), "--spec", str(tmp_path / "game.txt")]) == 2
    assert "not a name of a specification" in capsys.readouterr().err
    assert not (tmp_path / "game.txt").exists()
