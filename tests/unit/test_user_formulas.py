"""Formulas that a problem carries beside its task: read, refused, judged, recorded and shown."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
from scripts.schemas import shipped

from dubins_traffic.cars.state import Frames
from dubins_traffic.cli.main import main
from dubins_traffic.errors import InputError
from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.formulas import check_formulas
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.rules.vocabulary import Proposition, Vocabulary
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.formulas import FormulaVerdicts
from dubins_traffic.scoring.score import score
from tests.judging import GRID, case
from tests.minute import a_minute
from tests.recordings import blocks
from tests.unit.test_formula_syntax import MALFORMED

DOCS = Path(__file__).parents[2] / "docs"
GRID_DOCUMENT: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": GRID.to_document(),
    "e-agents": [{"type": "wander", "name": "agent", "count": 2}],
    "duration": 12,
    "goals": [[0, 0], [2, 2]],
    "rules": True,
}
MINE = {
    "no crash": "[] !collision_ego",
    "moves": "<> !still_ego",
    "stops": "[] (entered_ego && in_crossing_ego -> Y stopped_ego)",
    "goals": "[]<> ego_t_0_0 && []<> ego_t_2_2",
    "empty centre": "F[0,5] (free_1_1 && !cross_ego_1_1)",
    "never": "true U[1,2 s] false",
}

Command = Callable[..., str]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: str, status: int = 0) -> str:
        capsys.readouterr()
        code = main([*arguments])
        out, err = capsys.readouterr()
        assert code == status, err
        return out if status == 0 else err

    return run


def document(formulas: object, **more: object) -> dict[str, Any]:
    return {**GRID_DOCUMENT, "formulas": formulas, **more}


def instance(formulas: object = MINE, **more: object) -> Instance:
    return draw(load_config(document(formulas, **more)), 3, 0)


def written(tmp_path: Path, formulas: object, **more: object) -> str:
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(document(formulas, **more)))
    return str(path)


def test_instances_carry_formulas() -> None:
    found = instance()
    assert found.problem.formulas == MINE
    made = instance_to_document(found)
    assert made["formulas"] == MINE
    assert instance_from_document(made) == found
    assert "formulas" not in instance_to_document(instance({}))
    assert "formulas" not in instance_to_document(found, version=0)
    jsonschema.validate(made, shipped("instance"))
    jsonschema.validate(document(MINE), shipped("configuration"))
    for wrong in ({"": "[] a"}, {"a": 1}, ["[] a"]):
        with pytest.raises(jsonschema.ValidationError):
            jsonschema.validate({**made, "formulas": wrong}, shipped("instance"))


@pytest.mark.parametrize(
    ("formulas", "message"),
    [
        ({"mine": "[] (left_ego ->"}, "formulas.mine: line 1, column 16: ends too early: got '[] (left_ego ->'"),
        ({"mine": "[] left_ego\n &&\n U"}, "formulas.mine: line 3, column 2: unexpected 'U'"),
        ({"a": "[] left_ego", "b": "<> ("}, "formulas.b: line 1, column 5: ends too early"),
        ({"mine": ""}, "formulas.mine: line 1, column 1: ends too early"),
        ({"mine": "F[2,1] left_ego"}, "formulas.mine: line 1, column 2: not an interval"),
        ({"mine": "<> left_eg0"}, "formulas.mine: line 1, column 4: unknown proposition: got 'left_eg0'; "
         "expected one of the problem's propositions, such as left_ego"),
        ({"mine": "on_road_ego &&\n  [] !left_agent7"}, "formulas.mine: line 2, column 7: unknown proposition"),
        ({"mine": "[] !stopped_ego_0_0"}, "column 5: unknown proposition: got 'stopped_ego_0_0'"),
        ({"mine": "[] !enter_ego_1_7"}, "column 5: unknown proposition: got 'enter_ego_1_7'"),
        ({"mine": "<> exit_ego"}, "column 4: unknown proposition: got 'exit_ego'"),
        ({"mine": "<> ego_s_0_0_1_1"}, "column 4: unknown proposition: got 'ego_s_0_0_1_1'"),
        ({"mine": "Y F left_ego"}, "formulas.mine: a past operator ranges over a future one"),
        ({"mine": 3}, "formulas.mine: wrong value: got 3; expected a text"),
        ({"a/b": "<> left_ego"}, "formulas.a/b: not a name of a formula: got 'a/b'"),
        ([], "formulas: wrong value: got []; expected an object"),
        ({f"f{k}": "<> left_ego" for k in range(101)}, "formulas: wrong value"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_placed(command: Command, tmp_path: Path, formulas: object, message: str) -> None:
    file = written(tmp_path, formulas)
    error = command("run", file, "--records", str(tmp_path / "out"), status=2)
    assert error.startswith(f"dubins-traffic: {file}: formulas")
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
    made = {**instance_to_document(instance({})), "formulas": formulas}
    with pytest.raises(InputError, match=re.escape(message)):
        instance_from_document(made, "mine.json")


def test_malformed_formulas_are_placed_in_the_document() -> None:
    for text, line, column in MALFORMED:
        with pytest.raises(InputError) as caught:
            load_config(document({"mine": text}))
        placed = f"formulas.mine: line {line}, column {column}: "
        assert str(caught.value).startswith(placed), text[:80]
        assert "\n" not in str(caught.value)
        assert len(str(caught.value)) < 500


def test_version_0_keeps_the_key_and_means_nothing_by_it() -> None:
    old = instance_to_document(instance({}), version=0)
    found = instance_from_document({**old, "formulas": {"mine": "("}})
    assert found.problem.formulas == {}
    assert found.extra == {"formulas": {"mine": "("}}


def test_too_large_a_formula_is_refused_with_its_name() -> None:
    long = " || ".join(f"<> (enter_ego_{x}_{y} && X on_road_ego)" for x in range(3) for y in range(3))
    with pytest.raises(InputError, match=r"^formulas\.long: too ") as caught:
        instance({"short": "<> on_road_ego", "long": long + " || <> left_ego || <> still_ego || <> blocked_ego"})
    assert caught.value.expected


def test_names_of_cars_that_make_propositions_ambiguous() -> None:
    made = case(GRID, 3)
    words = Vocabulary(made.problem, ("ego", "clear_ego", "ego_1_1"))
    assert words["clear_ego_0_1"] == Proposition("clear", 0, GRID.vertex((0, 1)))
    assert words["clear_clear_ego"] == Proposition("clear", 1, -1)
    with pytest.raises(FormulaError, match="ambiguous proposition: got 'clear_ego_1_1'"):
        words["clear_ego_1_1"]


@pytest.mark.parametrize(
    ("name", "proposition"),
    [
        ("left_agent0", ("left", 1, -1)),
        ("at_fault_ego", ("at_fault", 0, -1)),
        ("way_ego", ("way", 0, -1)),
        ("exit_agent0", ("exit", 1, -1)),
        ("ego_t_1_0", ("at", 0, GRID.vertex((1, 0)))),
        ("free_1_0", ("free", -1, GRID.vertex((1, 0)))),
        ("cross_agent0_1_0", ("cross", 1, GRID.vertex((1, 0)))),
        ("first_ego_1_1", ("first", 0, GRID.vertex((1, 1)))),
        ("ego_s_0_0_1_0", ("segment", 0, GRID.segments.index((0, 0, 1, 0)))),
        ("lane_ego_0_0_1_0", ("lane", 0, 2 * GRID.segments.index((0, 0, 1, 0)))),
        ("lane_ego_1_0_0_0", ("lane", 0, 2 * GRID.segments.index((0, 0, 1, 0)) + 1)),
    ],
)
def test_propositions(name: str, proposition: tuple[str, int, int]) -> None:
    made = case(GRID, 2)
    assert tuple(Vocabulary(made.problem, made.names)[name]) == proposition


def test_without_rules_there_are_none_of_the_assumption() -> None:
    made = instance({"mine": "<> left_ego"}, rules=False)
    assert made.problem.formulas == {"mine": "<> left_ego"}
    for word in ("exit_agent0", "way_ego", "renewed_agent0", "excess_agent0"):
        with pytest.raises(InputError, match="unknown proposition"):
            instance({"mine": f"<> {word}"}, rules=False)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("records") / "a.mcap"
    run_trial(instance(), "lanes", record=path)
    return path


def verdicts(found: Instance, frames: Frames, size: int) -> list[tuple[str, str, float | None]]:
    sink = FormulaVerdicts()
    sink.begin(found)
    for block in blocks(frames, size):
        sink.frames(block)
    return [(one.name, one.verdict, one.time) for one in sink.result()]


def test_verdicts_of_a_trial(record: Path) -> None:
    kept = read(str(record))
    found = score(kept)
    assert found.verdict is not None
    said = {one.name: (one.verdict, one.time) for one in found.formulas}
    assert [one.formula for one in found.formulas] == list(MINE.values())
    crashed = [one.time for one in found.verdict.violations if one.rule == "1.collision"]
    assert said["no crash"] == (("false", crashed[0]) if crashed else ("presumably true", None))
    rolled = [one.time for one in found.verdict.violations if (one.rule, one.car) == ("3.stop", "ego")]
    assert said["stops"] == (("false", rolled[0]) if rolled else ("presumably true", None))
    at = {name: found.verdict.formulas[f"1.goal {name}"] for name in ("0 0", "2 2")}
    least = "presumably false" if "presumably false" in at.values() else "presumably true"
    assert said["goals"] == (least, None)
    assert said["never"] == ("false", 0.0)
    assert said["moves"][0] == "true"
    still = kept.frames.bits[:, 0] & FLAG.STILL != 0
    assert said["moves"][1] == int(np.argmin(still)) / 30
    assert said["empty centre"][0] == "true"


@pytest.mark.parametrize("size", [1, 7, 100])
def test_verdicts_do_not_depend_on_how_frames_are_cut(record: Path, size: int) -> None:
    kept = read(str(record))
    assert verdicts(kept.instance, kept.frames, size) == verdicts(kept.instance, kept.frames, 1000)


def test_the_first_frame_can_decide() -> None:
    made = instance({"t": "true", "first": "on_road_ego", "bounded": "G[0,0.1] on_road_ego"})
    result = run_trial(made, "simple")
    found = [(one.verdict, one.time) for one in result.score.formulas]
    assert found == [("true", 0.0), ("true", 0.0), ("true", 3 / 30)]


def test_commands_show_them(command: Command, tmp_path: Path) -> None:
    file = written(tmp_path, MINE)
    live = json.loads(command("run", file, "--records", str(tmp_path / "out"), "--json"))
    kept = str(tmp_path / "out" / "trial-0000.mcap")
    rescored = json.loads(command("score", kept, "--json"))
    assert rescored["trials"][0]["formulas"] == live["trials"][0]["formulas"]
    checked = json.loads(command("check", kept, "--json"))["records"][0]
    assert checked["formulas"] == live["trials"][0]["formulas"]
    assert [one["name"] for one in checked["formulas"]] == list(MINE)
    assert all(set(one) == {"name", "formula", "verdict", "time", "early", "robustness"} for one in checked["formulas"])
    text = command("check", kept)
    for words in ("no crash: ", "never: false since 0.000 s", "goals: presumably "):
        assert words in text
    for table in (command("score", kept), command("run", file)):
        assert re.search(r"0 never +false since 0\.000 s", table)
    command("replay", kept, "-o", str(tmp_path / "page.html"))
    page = (tmp_path / "page.html").read_text()
    assert '["formula never","false since 0.000 s"]' in page
    assert '"never is false"' in page


def test_formulas_are_asked_of_a_record_that_carries_none(command: Command, tmp_path: Path) -> None:
    """What is said of them is what is said where the configuration carries them."""
    live = json.loads(command("run", written(tmp_path, MINE), "--json"))["trials"][0]["formulas"]
    command("run", written(tmp_path, {}), "--records", str(tmp_path / "out"))
    kept = str(tmp_path / "out" / "trial-0000.mcap")
    asked = [word for name, text in MINE.items() for word in ("--formula", f"{name}={text}")]
    assert json.loads(command("check", kept, "--json", *asked))["records"][0]["formulas"] == live
    text = command("check", kept, "--formula", "[] on_road_ego")
    assert re.search(r"\n  \[\] on_road_ego: (presumably true|false since)", text)
    text = command("check", kept, "--formula", "on_road_ego => left_ego", "--formula", "b=on_road_ego -> left_ego")
    said = dict(re.findall(r"\n  (.+): (true|false since .+|presumably .+)", text))
    assert said["on_road_ego => left_ego"] == said["b"] == "false since 0.000 s"


@pytest.mark.parametrize("wrong", ["[] lefd_ego", "mine=[] (", "a <= b"])
def test_a_formula_that_can_not_be_asked_is_refused(
    wrong: str, command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command("run", written(tmp_path, {}), "--records", str(tmp_path / "out"))
    assert main(["check", str(tmp_path / "out" / "trial-0000.mcap"), "--formula", wrong]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"formulas.{wrong.partition('=')[0] if 'mine' in wrong else wrong}: line 1, column" in line


def test_two_formulas_of_one_name_are_refused(
    command: Command, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command("run", written(tmp_path, {}), "--records", str(tmp_path / "out"))
    words = ["--formula", "a=true", "--formula", "a = false"]
    assert main(["check", str(tmp_path / "out" / "trial-0000.mcap"), *words]) == 2
    assert "--formula: two formulas of one name: got 'a'" in capsys.readouterr().err


def test_a_problem_without_rules_is_checked_by_its_formulas(command: Command, tmp_path: Path) -> None:
    command("run", written(tmp_path, {"mine": "[] on_road_ego"}, rules=False), "--records", str(tmp_path))
    text = command("check", str(tmp_path / "trial-0000.mcap"))
    assert "not judged" in text
    assert re.search(r"\n  mine: (presumably true|false since)", text)


def test_the_example_of_the_documentation_can_be_judged() -> None:
    text = (DOCS / "verdicts.md").read_text()
    example = re.search(r'^"formulas": \{\n(?:.*\n)+?\}', text, re.MULTILINE)
    assert example is not None
    found = json.loads("{" + example[0] + "}")["formulas"]
    made = draw(a_minute("town"), 0, 0)
    check_formulas(replace(made.problem, formulas=found), made.names)
    assert len(found) >= 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "<>[0,1e308] still_ego",
            "expected [a, b] with 0 <= a <= b <= 1e+09, seconds",
        ),
        (
            "[] (still_ego -> <>[1e8,1e9] left_ego)",
            "begins too late: got 3000000000; expected at most 1000000 ticks",
        ),
        ("!" * 5_000 + "still_ego", "nested too deeply"),
        ("X " * 50_000 + "still_ego", "nested too deeply"),
        ("(" * 50_000 + "still_ego", "ends too early"),
        ("still_ego U " * 5_000 + "still_ego", "nested too deeply"),
        ("(" * 250_000 + "still_ego", "too long"),
    ],
    ids=range(7),
)
def test_huge_bounds_and_deep_formulas_are_wrong_input(
    command: Command, tmp_path: Path, text: str, message: str
) -> None:
    told = command("run", written(tmp_path, {"mine": text}), status=2)
    assert "formulas.mine" in told
    assert message in told


def test_parts_that_contradict_each_other_are_false_at_frame_0(command: Command, tmp_path: Path) -> None:
    large = " && ".join(f"[] (still_ego -> <> cross_ego_{k % 3}_{k // 3})" for k in range(9))
    formulas = {"early": "[] still_ego && <> !still_ego", "large": large}
    path = written(tmp_path, formulas, duration=1)
    (row,) = json.loads(command("run", path, "--controller", "simple", "--json"))["trials"]
    early, late = row["formulas"]
    assert (early["verdict"], early["time"], early["early"]) == ("false", 0.0, True)
    assert late["early"] is False
    assert "(judged by parts)" in command("run", path, "--controller", "simple")
