"""The task as formulas: what it says, whose propositions they are, and how the command writes it."""

from __future__ import annotations

import ast
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time

import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.cli.spec import PLAIN, SUFFIXES, Format
from dubins_traffic.errors import InputError
from dubins_traffic.logic.formula import Op, conj, propositions, subformulas
from dubins_traffic.logic.parse import parse
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.runs.single import run_trial
from dubins_traffic.specifications.exports import FORMATS, Specification
from dubins_traffic.specifications.task import task
from tests.judging import GRID, case

Command = Callable[..., str]


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    def run(*arguments: str, status: int = 0) -> str:
        capsys.readouterr()
        code = main(["spec", *arguments])
        out, err = capsys.readouterr()
        assert code == status, err
        return out if status == 0 else err

    return run


def write(instance: Instance, path: Path) -> str:
    path.write_text(json.dumps(instance_to_document(instance)))
    return str(path)


@pytest.fixture
def demo(tmp_path: Path) -> str:
    return write(draw(load_config("demo"), 0, 0), tmp_path / "demo.json")


@pytest.fixture
def town(tmp_path: Path) -> str:
    return write(draw(load_config("town"), 0, 0), tmp_path / "town.json")


def test_a_task_without_rules_says_so_beside_the_formulas(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, town: str
) -> None:
    told = tmp_path / "told.json"
    assert main(["instance", "town", "-o", str(told)]) == 0
    capsys.readouterr()
    assert main(["spec", str(told)]) == 0
    out, err = capsys.readouterr()
    assert out.count("[]<>") == 4
    assert "G" not in out
    assert err.count("\n") == 1
    assert "no rules of the road are in it" in err
    assert main(["spec", town]) == 0
    assert not capsys.readouterr().err


def of(instance: Instance) -> Specification:
    return task(instance.problem, instance.names)


def said(spec: Specification) -> list[str]:
    return [str(formula) for formula in spec.assumptions]


def test_the_task_of_2016(command: Command, demo: str) -> None:
    goals = json.loads(Path(demo).read_text())["goals"]
    wanted = " && ".join(f"([]<> ego_t_{x}_{y})" for x, y in goals)
    assert command(demo) == wanted + "\n"
    assert command(demo, "--guarantee") == wanted + "\n"
    assert command(demo, "--assumption") == "true\n"
    assert parse(command(demo, "--format", "spin")) is parse(wanted)


def test_a_goal_drawn_twice_is_one() -> None:
    instance = draw(load_config("demo"), 0, 0)
    goals = ((1, 1), (0, 2), (1, 1))
    spec = of(replace(instance, problem=replace(instance.problem, goals=goals)))
    assert conj(*spec.guarantees) is parse("[]<> ego_t_1_1 && []<> ego_t_0_2")


def test_the_rules_of_the_ego() -> None:
    spec = of(case(GRID, 1, [(2, 2)], left_time=7.5, crossing_degree=4))
    wanted = """
        [] !collision_ego && [] (Y on_road_ego -> on_road_ego) && []<> visit_ego_2_2
        && [] (left_ego -> overtaking_ego) && [] (left_ego -> <>[0,7.5] (!left_ego || hemmed_ego))
        && [] !turned_ego && [] (enter_ego_1_1 -> Y stopped_ego_1_1) && [] (enter_ego_1_1 -> Y !ahead_ego_1_1)
        && [] (enter_ego_1_1 -> Y clear_ego_1_1)
    """
    assert conj(*spec.guarantees) is parse(wanted)
    assert spec.assumptions == (parse("[]<> free_2_2"),)
    assert set(spec.inputs) == {"overtaking_ego", "hemmed_ego", "ahead_ego_1_1", "clear_ego_1_1", "free_2_2"}


def test_the_assumption() -> None:
    spec = of(case(GRID, 2, [(0, 0)], crossing_degree=4))
    wanted = """
        [] (Y on_road_agent0 -> on_road_agent0)
        && [] (left_agent0 -> overtaking_agent0) && [] (left_agent0 -> <>[0,10] (!left_agent0 || hemmed_agent0))
        && [] !turned_agent0
        && [] (enter_agent0_1_1 -> Y stopped_agent0_1_1) && [] (enter_agent0_1_1 -> Y !ahead_agent0_1_1)
        && [] (enter_agent0_1_1 -> Y clear_agent0_1_1)
        && [] !at_fault_agent0
        && [] ((first_agent0_1_1 && clear_agent0_1_1) -> <>[0,10] !(first_agent0_1_1 && clear_agent0_1_1))
        && [] !renewed_agent0
        && [] (exit_agent0 -> <>[0,5] !exit_agent0) && [] !stays_agent0
        && [] !overdue_agent0
        && []<> free_0_0
    """
    assert conj(*spec.assumptions) is parse(wanted)
    others = {name for formula in spec.assumptions for name in propositions(formula)}
    assert others <= set(spec.inputs)


@pytest.mark.parametrize(
    ("number", "words"),
    [
        (1, ("on_road_", "left_", "turned_", "enter_")),
        (2, ("at_fault_",)),
        (3, ("first_", "renewed_")),
        (4, ("exit_", "stays_")),
        (5, ("overdue_",)),
        (6, ("free_",)),
    ],
)
def test_a_problem_says_what_it_assumes(number: int, words: tuple[str, ...]) -> None:
    whole = said(of(case(GRID, 2, [(0, 0)])))
    part = said(of(case(GRID, 2, [(0, 0)], **{f"assume_e{number}": 0})))
    assert part == [text for text in whole if not any(word in text for word in words)] != whole


def test_exceptions_are_counted_by_a_proposition() -> None:
    found = said(of(case(GRID, 2, [(0, 0)], exceptions=2)))
    assert found[0] == "G !excess_agent0"
    assert not any("left_" in text for text in found)


def test_a_name_that_propositions_can_not_carry() -> None:
    instance = case(GRID, 2)
    with pytest.raises(InputError, match="not a name of a proposition"):
        task(instance.problem, ("ego", "agent-1"))


def test_output_parses_back(command: Command, town: str) -> None:
    spec = of(draw(load_config("town"), 0, 0))
    assert parse(command(town)) is spec.whole
    assert parse(command(town, "--assumption")) is conj(*spec.assumptions)
    assert parse(command(town, "--guarantee")) is conj(*spec.guarantees)


def test_a_record_has_the_task_of_its_instance(command: Command, tmp_path: Path, demo: str) -> None:
    instance = replace(draw(load_config("demo"), 0, 0), duration=1.0)
    run_trial(instance, "simple", record=tmp_path / "a.mcap")
    assert command(str(tmp_path / "a.mcap")) == command(demo)


def test_formats_are_those_of_the_exports() -> None:
    assert [*Format] == [*FORMATS]


@pytest.mark.parametrize("part", [(), ("--assumption",), ("--guarantee",)])
@pytest.mark.parametrize("format", ["spot", "stl", "tlsf", "slugs", "tulip", "latex"])
def test_the_rules_in_every_format(
    command: Command, tmp_path: Path, town: str, format: str, part: tuple[str, ...]
) -> None:
    out = tmp_path / f"out{SUFFIXES.get(Format(format), PLAIN)[0]}"
    assert command(town, "--format", format, *part, "-o", str(out)) == ""
    text = out.read_text().replace("\\_", "_")
    assert ("left_ego" in text) == ("--assumption" not in part)
    assert ("at_fault_car0" in text) == ("--guarantee" not in part)
    assert text.endswith("\n")
    if format == "tulip":
        ast.parse(text)


def test_a_huge_network_takes_seconds() -> None:
    """Four times the intersections take about four times as long to write."""
    quarter, spec = (of(case(RoadNetwork.grid(n, n, 5.0), 2, [(n - 1, n - 1)])) for n in (15, 30))
    assert len(spec.guarantees) == 6 + 3 * (900 - 4)
    for name, write in FORMATS.items():
        began = process_time()
        write(quarter, 20.0)
        between = process_time()
        text = write(spec, 20.0)
        assert process_time() - between < 10.0 * (between - began) + 0.5, name
        assert text.replace("\\", "").count("ahead_ego_13_7") >= 1, name


def test_spin_with_a_longer_period(command: Command, town: str) -> None:
    text = command(town, "--format", "spin", "--period", "2")
    found = parse(text)
    assert all(part.bounds is None for part in subformulas(found))
    assert not any(part.op in (Op.Y, Op.S) for part in subformulas(found))


def test_what_a_format_can_not_say_is_named(command: Command, town: str) -> None:
    error = command(town, "--format", "spin", "--guarantee", status=2)
    assert "[] (left_ego -> <>[0,10] (!left_ego || hemmed_ego))" in error
    assert "a bound of 10 s is too long" in error
    assert "a period of at least 0.25 s" in error
    assert command(town, "--format", "spin", "--guarantee", "--period", "0.25")
    whole = command(town, "--format", "spin", status=2)
    assert "a period of at least 0.25 s" in whole
    assert command(town, "--format", "spin", "--period", "0.25")
    assert error.startswith(f"dubins-traffic: {town}: --format spin: ")


@pytest.mark.parametrize(
    "arguments",
    [
        ("--format", "prolog"),
        ("--period", "0"),
        ("--period", "-1"),
        ("--period", "nan"),
        ("--period", "inf"),
        ("--period", "x"),
    ],
)
def test_wrong_options(command: Command, demo: str, arguments: tuple[str, ...]) -> None:
    error = command(demo, *arguments, status=2)
    assert arguments[0] in error
    assert error.count("\n") == 1


def test_wrong_files(command: Command, tmp_path: Path) -> None:
    assert "no-such.json" in command("no-such.json", status=2)
    (tmp_path / "grid.json").write_text(json.dumps(GRID.to_document()))
    assert "expected a problem instance or a record" in command(str(tmp_path / "grid.json"), status=2)
    assert "expected a problem instance or a record" in command("demo", status=2)
