"""Strategies from strangers: whatever stands in the file, one clear message, soon, and in little memory."""

from __future__ import annotations

import warnings
from itertools import chain
from pathlib import Path

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.foreign import hoa
from dubins_traffic.synthesis.foreign.read import read_machine

HOA = 'HOA: v1\nStates: 1\nStart: 0\nAP: 2 "a" "b"\n--BODY--\nState: 0\n[%s] 0\n--END--\n'
TULIP = "class TulipStrategy:\n    a = "
SLUGS = '{"variables": %s, "nodes": {"0": {"state": [], "trans": []}}}'
WIDE = "|".join(["0"] * 4000)
HOSTILE: dict[str, tuple[str | bytes, str]] = {
    "deep brackets": (HOA % ("(" * 100_000), "nested more than 50 deep"),
    "deep negations": (HOA % ("!" * 100_000), "nested more than 50 deep"),
    "a digit that is none": (HOA % "²", "not a label"),
    "a long number": (HOA % ("9" * 5000), "not a label"),
    "a long state": (HOA.replace("] 0", "] " + "9" * 5000) % "0", "no state's number"),
    "a long first state": (HOA.replace("Start: 0", "Start: " + "9" * 5000) % "0", "no state's number"),
    "two first states": (HOA.replace("Start: 0", "Start: 0&1") % "0", "not one state"),
    "too many propositions": (
        HOA.replace('2 "a" "b"', "2000 " + '"a" ' * 2000) % "0",
        "more than 1024 propositions",
    ),
    "a product of sums": (HOA % f"({WIDE})&({WIDE})&({WIDE})", "too long a label"),
    "sets that are not closed": (HOA % ("{" * 400_000), "label"),
    "comments that are not closed": (HOA % ("/*" * 400_000), "label"),
    "texts that are not closed": (HOA % ('"' + '\\"' * 400_000 + "\\"), "label"),
    "empty lines": (
        "HOA: v1\n" + "\n" * 400_000 + "x" + HOA.replace("Start", "Begin") % "0",
        "not one Start",
    ),
    "variables that are a number": (SLUGS % 5, "variables and nodes"),
    "variables that are nothing": (SLUGS % "null", "variables and nodes"),
    "a header of many digits": ("aag " + "9" * 5000 + " 0 0 0 0\n", "not a header"),
    "many inputs": ("aig 10 99999999999 0 0 0\n", "too large a circuit"),
    "a delta without an end": (b"aig 3 1 0 0 1\n" + b"\xff" * 2_000_000 + b"\x01\x01", "cut off"),
    "a deep expression": (TULIP + "-" * 100_000 + "1", "dumpsmach"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_hostile_is_refused(name: str, tmp_path: Path) -> None:
    text, message = HOSTILE[name]
    path = tmp_path / "strategy"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError, match=message) as caught:
        read_machine(path)
    said = str(caught.value)
    assert said.startswith(str(path)[:20])
    assert "None" not in said
    assert len(said.splitlines()) == 1


def test_all_labels_together_are_limited(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "strategy"
    path.write_text(HOA % ("(0|1)" + "&(0|1)" * 9))
    assert read_machine(path).step(0, {"a": True, "b": False}) is not None
    monkeypatch.setattr(hoa, "MOST_STEPS", 1000)
    with pytest.raises(InputError, match="labels that take too long"):
        read_machine(path)
    monkeypatch.setattr(hoa, "MOST_STEPS", 10_000)
    monkeypatch.setattr(hoa, "MOST_LITERALS", 1000)
    with pytest.raises(InputError, match="more than 1000 literals"):
        read_machine(path)


def test_nothing_is_said_of_python_that_is_odd(tmp_path: Path) -> None:
    path = tmp_path / "strategy"
    path.write_text(TULIP + '"\\d" is 1\n')
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        with pytest.raises(InputError, match="dumpsmach"):
            read_machine(path)
    assert said == []


def test_a_node_may_have_any_name(tmp_path: Path) -> None:
    """Of slugs' JSON, where names of nodes are texts: none is that of the state before the first letter."""
    path = tmp_path / "strategy"
    nodes = '"first": {"state": [0, 1], "trans": ["last"]}, "last": {"state": [1, 0], "trans": []}'
    path.write_text(f'{{"variables": ["a", "ego_0"], "nodes": {{{nodes}}}}}')
    machine = read_machine(path)
    state, answers = machine.begin(), list[bool]()
    for a in chain([False], [True]):
        step = machine.step(state, {"a": a})
        assert step is not None
        state = step[0]
        answers.append(step[1]["ego_0"])
    assert answers == [True, False]


def test_names_may_stand_on_lines_of_their_own(tmp_path: Path) -> None:
    path = tmp_path / "strategy"
    path.write_text((HOA % "0&!1").replace('2 "a" "b"', '2\n  "a"\n  "b" /* the ego\'s */'))
    assert list(read_machine(path).names) == ["a", "b"]
