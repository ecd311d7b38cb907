"""What judging by the rules of the road adds to a batch of trials whose e-agents drive.

A step of the batch is that of `docs/semantics.md`: sense, decide, move, label every car with its propositions.
Judging is what the rules need on top: the referee.
"""

from __future__ import annotations

from dataclasses import replace
from time import process_time

import numpy as np

from benchmarks.table import Row
from dubins_traffic.agents.fleet import Fleet
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.problem.instance import Instance
from dubins_traffic.rules.labeller import Labeller
from dubins_traffic.rules.parameters import RuleParameters
from dubins_traffic.rules.referee import Referee
from dubins_traffic.simulators.embedded import Embedded

TRIALS, TICKS, WARM = 512, 150, 3


def measure() -> list[Row]:
    """Return the rows of this benchmark, from the sums over some simulated seconds."""
    config = load_config("benchmarks/traffic.json")
    instances = [_judged(draw(config, 1, trial)) for trial in range(64)] * (TRIALS // 64)
    simulator, fleet, labeller = Embedded(), Fleet(), Labeller(instances)
    referee = Referee(instances, labeller)
    state = simulator.reset(instances)
    fleet.reset(instances, state)
    labels = labeller.reset(state)
    referee.reset(state)
    commands = np.zeros((*state.x.shape, 2))
    driving = labelling = refereeing = 0.0
    breaches = 0
    for tick in range(TICKS + WARM):
        commands[:, 0] = 0.5, 0.1
        began = process_time()
        fleet.decide(tick, state, labels, commands)
        contacts = simulator.step(commands)
        moved = process_time()
        contacts = labeller.update(tick + 1, state, contacts)
        labelled = process_time()
        breaches += sum(map(len, referee.update(tick + 1, state, contacts)))
        ended = process_time()
        if tick >= WARM:
            driving += moved - began
            labelling += labelled - moved
            refereeing += ended - labelled
    cars = state.x.size
    steps = cars * TICKS
    share = refereeing / (driving + labelling)
    parts = f"{driving / steps * 1e9:.0f} + {labelling / steps * 1e9:.0f} ns a car"
    found = f"{refereeing / steps * 1e9:.0f} ns a car = {share:.0%} of it"
    return [
        Row(f"move with drivers + label, {TRIALS} trials x {cars // TRIALS} cars", parts, "", True),
        Row(f"judge, {breaches} breaches found", found, "<= 100 %", share <= 1.0),
    ]


def _judged(instance: Instance) -> Instance:
    rules = RuleParameters().to_mapping()
    return replace(instance, problem=replace(instance.problem, rules=rules))
