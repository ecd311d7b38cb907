"""The task of whole problems, as `dubins-traffic spec` writes it, read by the tools that it is for."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cli.main import main
from dubins_traffic.logic.automaton import PRESUMABLY_TRUE
from dubins_traffic.logic.formula import Formula, Op, make, propositions, subformulas, to_spin
from dubins_traffic.logic.monitor import Monitors
from dubins_traffic.logic.parse import parse
from dubins_traffic.logic.rewrite import mapped
from dubins_traffic.logic.robustness import robustness
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.record.reader import read
from dubins_traffic.rules.valuation import Valuation
from dubins_traffic.rules.vocabulary import Vocabulary
from dubins_traffic.runs.single import run_trial
from dubins_traffic.scoring.signals import Signals
from dubins_traffic.specifications.exports import Specification, stl
from dubins_traffic.specifications.task import task
from tests.crosscheck.test_formula_tools import asked, spin_output
from tests.formulas import holds
from tests.grammars import slugs_sections, tlsf_sections
from tests.rules_scripts import STAR

Spec = Callable[..., str]
SMALL: dict[str, Any] = {
    "version": 1,
    "problem_domain": "dubins_traffic",
    "rnd": STAR.to_document(),
    "rate": 10,
    "rules": True,
    "duration": 20,
    "goals": [[0, 1], [2, 1]],
    "e-agents": [{"type": "wander", "name": "rogue", "count": 2}],
}


@pytest.fixture
def spec(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Spec:
    """Return what the command prints of an instance's task."""

    def run(instance: Instance, *arguments: str) -> str:
        file = tmp_path / "instance.json"
        file.write_text(json.dumps(instance_to_document(instance)))
        capsys.readouterr()
        code = main(["spec", str(file), *arguments])
        out, err = capsys.readouterr()
        assert code == 0, err
        return out

    return run


@pytest.fixture
def small() -> Instance:
    return draw(load_config(SMALL), 2, 0)


@pytest.fixture
def town() -> Instance:
    return draw(load_config("town"), 0, 0)


class Buchi:
    """A never claim of SPIN's as what it is, a Büchi automaton."""

    def __init__(self, claim: str) -> None:
        self.ways: dict[str, list[tuple[str, str]]] = {}
        self.accepting = {"accept_all"}
        labels: list[str] = []
        for line in claim.splitlines()[1:]:
            label = re.fullmatch(r"(\w+):", line.strip())
            if label is not None:
                labels = [label[1]] if labels and self.ways[labels[0]] else [*labels, label[1]]
                self.ways |= {name: [] for name in labels}
                if any(name.startswith("accept") for name in labels):
                    self.accepting.update(labels)
            for name in labels:
                self.ways[name] += self._ways(line.strip(), name)
        self.first = next(iter(self.ways))
        self.ways.setdefault("accept_all", [("True", "accept_all")])

    @staticmethod
    def _ways(line: str, own: str) -> list[tuple[str, str]]:
        if line == "skip":
            return [("True", own)]
        found = re.fullmatch(r":: (.*) -> goto (\w+)", line)
        done = re.fullmatch(r":: atomic \{ (.*) -> assert\(.*\) \}", line)
        if found is None and done is None:
            return []
        shield_filter, target = found.groups() if found else (done[1] if done else "", "accept_all")
        return [(shield_filter.replace("!", " not ").replace("&&", " and ").replace("||", " or ").strip(), target)]

    def accepts(self, word: list[dict[str, bool]], loop: int) -> bool:
        """Say whether the word is accepted whose last `loop` letters go on for ever."""
        after = [*range(1, len(word)), len(word) - loop]

        def reached(nodes: list[tuple[str, int]]) -> set[tuple[str, int]]:
            seen, stack = set[tuple[str, int]](), list(nodes)
            while stack:
                state, place = stack.pop()
                for shield_filter, target in self.ways[state]:
                    node = target, after[place]
                    if node not in seen and eval(shield_filter, {}, word[place]):
                        seen.add(node)
                        stack.append(node)
            return seen

        nodes = {(self.first, 0), *reached([(self.first, 0)])}
        return any(node in reached([node]) for node in nodes if node[0] in self.accepting)


def check_on_lassos(text: str, meant: Formula, random: Random) -> None:
    """Check on random words that SPIN takes a formula as it is meant."""
    automaton = Buchi(spin_output(text))
    names = propositions(meant)
    for _ in range(60):
        letters = [random.randrange(1 << len(names)) for _ in range(random.randint(1, 6))]
        loop = random.randint(1, len(letters))
        word = [{name: bool(one >> bit & 1) for bit, name in enumerate(names)} for one in letters]
        prefix, tail = np.array([letters[:-loop]], dtype=np.int64), np.array([letters[-loop:]])
        assert automaton.accepts(word, loop) == bool(holds(meant, prefix, tail, names)[0]), text


@pytest.mark.parametrize("name", ["demo", "mc-small-4grid-agents2"])
@pytest.mark.tools
def test_spin_reads_the_tasks_of_2016(spec: Spec, name: str) -> None:
    for number in range(3):
        text = spec(draw(load_config(name), 0, number), "--format", "spin").strip()
        check_on_lassos(text, parse(text), Random(number))


@pytest.mark.parametrize("part", ["--assumption", "--guarantee"])
@pytest.mark.tools
def test_spin_reads_the_rules_as_they_are_meant(spec: Spec, town: Instance, part: str) -> None:
    """Each kind of part alone, since SPIN's automaton of a conjunction has a state for every subset of its parts.

    Debian's SPIN is built without next: eventually, which stands in the same places, is put for it on both sides.
    """
    text = spec(town, "--format", "spin", "--period", "20", part).strip()
    sides = [side.args if side.op is Op.AND else (side,) for side in parse(text).args]
    shapes = {re.sub(r"\w*[a-z]\w*", "p", to_spin(one)): one for parts in sides for one in parts}
    assert 4 < len(shapes) < sum(map(len, sides)) / 3
    random = Random(6)
    for formula in shapes.values():
        short = to_spin(formula)
        assert short in text
        meant = mapped(formula, lambda one: make(Op.F, one.args) if one.op is Op.X else one)
        check_on_lassos(re.sub(r"\bX\b", "<>", short), meant, random)


@pytest.mark.parametrize("part", [(), ("--assumption",), ("--guarantee",)])
@pytest.mark.tools
def test_rtamt_measures_the_task_on_a_recorded_trial(
    spec: Spec, small: Instance, tmp_path: Path, part: tuple[str, ...]
) -> None:
    run_trial(small, "lanes", record=tmp_path / "a.mcap")
    kept = read(str(tmp_path / "a.mcap"))
    whole = task(small.problem, small.names)
    formulas = {"--assumption": whole.assumptions, "--guarantee": whole.guarantees}
    text = spec(small, "--format", "stl", *part).strip()
    sides = [formulas[one] for one in part or formulas]
    names = sorted({name for side in sides for formula in side for name in propositions(formula)})
    values = Valuation(kept.instance, names).values(kept.frames)
    signals = dict(zip(names, np.where(values, 1.0, -1.0).T, strict=True))
    request = {
        "period_ms": 100,
        "signals": {name: signal.tolist() for name, signal in signals.items()},
        "formulas": [text],
    }
    ((answer,),) = asked("rtamt", "rtamt_robustness.py", [request])
    joint = parse(spec(small, *part))
    assert np.array_equal(robustness(joint, signals, 0.1), answer)
    monitors = Monitors({f"{k}": one for side in sides for k, one in enumerate(side)}, names, 0.1)
    monitors.reset(1)
    for row in values:
        monitors.update(row[None, :])
    if part:
        assert (answer[0] > 0) == bool((monitors.verdicts >= PRESUMABLY_TRUE).all())


ASKED = {
    "lane": "[] !left_ego",
    "road": "[] on_road_rogue0",
    "soon": "<>[0,6] ego_t_0_1",
    "back": "[][0,4] (left_ego -> <>[0,3] !left_ego)",
    "first": "(!ego_t_0_1 U[0,8] ego_t_2_1) | [][0,8] !collision_ego",
}


@pytest.mark.tools
def test_rtamt_measures_what_is_asked_of_fifty_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The formulas end within whole trials, so that what may come after counts in none; both are given the measures."""
    monkeypatch.chdir(tmp_path)
    formulas = {name: parse(text) for name, text in ASKED.items()}
    names = sorted({name for formula in formulas.values() for name in propositions(formula)})
    texts = [stl(Specification((), (formula,), tuple(names), ()), 0.1) for formula in formulas.values()]
    requests: list[Any] = []
    for number in range(50):
        instance = replace(draw(load_config(SMALL), 7, number), duration=10.0)
        path = f"{number:02}.mcap"
        run_trial(instance, "lanes" if number % 2 else "simple", record=path)
        kept = read(path)
        vocabulary = Vocabulary(instance.problem, instance.names)
        signals = Signals(kept.instance, {name: vocabulary[name] for name in names})
        signals.take(kept.frames, Valuation(kept.instance, names).values(kept.frames))
        measures = {name: signal.tolist() for name, signal in signals.result().items()}
        requests.append({"period_ms": 100, "signals": measures, "formulas": texts})
    capsys.readouterr()
    asking = [word for name, text in ASKED.items() for word in ("--formula", f"{name}={text}")]
    assert main(["check", *(f"{number:02}.mcap" for number in range(50)), *asking, "--json"]) in (0, 1)
    told = [
        [np.inf if found["robustness"] is None else found["robustness"] for found in record["formulas"]]
        for record in json.loads(capsys.readouterr().out)["records"]
    ]
    answers = asked("rtamt", "rtamt_robustness.py", requests)
    expected = [[row[0] for row in answer] for answer in answers]
    assert np.allclose(told, expected, rtol=0.0, atol=1e-6)
    assert {-1.0, 1.0} <= set(np.sign(expected).ravel())


@pytest.mark.tools
def test_tulip_finds_the_task_realizable_unless_the_ego_must_enter_whoever_is_ahead(
    spec: Spec, small: Instance
) -> None:
    alone = replace(small, problem=replace(small.problem, e_agents=("rogue0",)), e_agents=small.e_agents[:1])
    alone = replace(alone, starts=small.starts[:2])
    text = spec(alone, "--format", "tulip", "--period", "1")
    spoiled = text + "specification.sys_prog.append('enter_ego_1_1')\n"
    freed = spoiled + "specification.env_safety.append('clear_ego_1_1 & !ahead_ego_1_1')\n"
    assert asked("tulip", "tulip_realizable.py", [text, spoiled, freed]) == [True, False, True]


def test_tlsf_of_a_town_keeps_the_grammar(spec: Spec, town: Instance) -> None:
    whole = task(town.problem, town.names)
    sections = tlsf_sections(spec(town, "--format", "tlsf"))
    assert sum(len(sections[name]) for name in ("preset", "assert", "guarantee")) == len(whole.guarantees)
    assert set(sections["outputs"]) == set(whole.outputs)
    assert set(whole.inputs) < set(sections["inputs"])
    memories = len(sections["inputs"]) - len(whole.inputs)
    assumed = sum(len(sections[name]) for name in ("initially", "require", "assume"))
    assert assumed == len(whole.assumptions) + 2 * memories


def test_slugs_of_a_town_keeps_the_grammar(spec: Spec, town: Instance) -> None:
    whole = task(town.problem, town.names)
    sections = slugs_sections(spec(town, "--format", "slugs"))
    goals = list(dict.fromkeys(town.problem.goals))
    assert sections["ENV_LIVENESS"] == [f"free_{x}_{y}" for x, y in goals]
    assert sections["SYS_LIVENESS"] == [f"visit_ego_{x}_{y}" for x, y in goals]
    bounded = [
        formula
        for formula in (*whole.assumptions, *whole.guarantees)
        if any(part.bounds is not None for part in subformulas(formula))
    ]
    counters = [line for line in sections["INPUT"] + sections["OUTPUT"] if ":" in line]
    assert len(counters) == len(bounded)
    assert {int(line.split("...")[1]) for line in counters} == {150, 300}
