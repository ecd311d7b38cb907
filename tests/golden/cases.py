"""What the golden hashes are made of: trials, batches, campaigns, games, networks and instances, by name.

Every case gives parts, a name and bytes each. The bytes hold what a user could read, decoded: no versions, no layout of
a file, no wall-clock time. So they stay when files are laid out anew, and change when a meaning does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from pyarrow import parquet

import dubins_traffic as dt
from dubins_traffic.cli.main import main as command_line
from dubins_traffic.interchange.export import export
from dubins_traffic.logic.formula import FormulaError
from dubins_traffic.problem import document as documents
from dubins_traffic.problem import draw as drawing
from dubins_traffic.specifications.exports import FORMATS
from dubins_traffic.specifications.task import task
from dubins_traffic.synthesis.answer import answer
from dubins_traffic.synthesis.assumption import Assumption
from dubins_traffic.transports.clocks import Lockstep
from dubins_traffic.transports.lines import Lines
from dubins_traffic.transports.lines_client import drive
from dubins_traffic.transports.link import Link
from tests.golden.decoded import decoded_record, decoded_score, plain, replay_data

Parts = Iterator[tuple[str, bytes]]
Case = Callable[[Path], Parts]

SECONDS = 8
GRID = {"grid": {"rows": 3, "columns": 4}}
THINNED = {"grid": {"rows": 4, "columns": 4, "removed": 0.2, "rigid_motion": True}}
RANDOM = {"random": {"intersections": 9, "segments": 11, "rigid_motion": True}}
NETWORKS = {"grid": GRID, "thinned": THINNED, "random": RANDOM}

AGENTS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "wander": ("wander", {}),
    "wander-patient": ("wander", {"patience": 1.0}),
    "loop": ("loop", {}),
    "follow": ("follow", {"gap": 0.8}),
    "follow-sensing": ("follow", {"sensing_only": True}),
    "parked": ("parked", {"vacates_after": 3}),
    "scripted": ("scripted", {"commands": [[1.0, 0.3, 0.1], [0.5, 0.0, -1.0]], "repeat": True}),
    "lawful-wander": ("lawful", {"goes": "wander"}),
    "lawful-loop": ("lawful", {"goes": "loop"}),
    "lawful-places": ("lawful", {"goes": "places"}),
    "lawful-rolls": ("lawful", {"rolls": 1.0}),
    "lawful-left": ("lawful", {"left": 1.0}),
    "lawful-blocks": ("lawful", {"blocks": 1.0}),
    "lawful-tailgates": ("lawful", {"tailgates": 1.0}),
    "lawful-parks": ("lawful", {"parks": 1.0, "parks_for": 4.0}),
    "nemesis": ("nemesis", {}),
}

CONTROLLERS = (
    "lanes",
    "rules",
    "simple",
    "synthesized",
    "lanes+shield",
    "lanes+shield:law",
    "lanes+shield:never",
    "simple+shield",
    "rules+shield:law",
    f"{__name__}:Swerving",
    f"{__name__}:Swerving+shield",
    f"{__name__}:Swerving+shield:never",
)

VARIANTS: Mapping[str, Mapping[str, Any]] = {
    "plain": {},
    "obstacles": {
        "obstacles": [
            {"disc": {"x": 1.5, "y": -0.35, "radius": 0.15}},
            {"disc": {"x": 4.5, "y": 2.7, "radius": 0.2}},
            {"polygon": {"vertices": [[3.2, 4.2], [3.5, 4.2], [3.5, 4.6], [3.2, 4.6]]}},
        ]
    },
    "rectangles": {
        "network": {"grid": {"rows": 3, "columns": 4, "length": 3.5}},
        "car": {"w": 0.3, "body": {"rectangle": {"length": 0.45, "width": 0.3}}},
    },
    "turning-radius": {"car": {"bounds": {"speed": 0.7, "yaw_rate": 3.0, "turning_radius": 0.25}}},
    "disturbed": {
        "disturbances": {
            "position_noise": 0.01,
            "heading_noise": 0.01,
            "command_delay": 2,
            "command_loss": 0.05,
        }
    },
    "laser": {"laser": True},
    "slow-rate": {"rate": 20},
    "ends": {"end_on_collision": True},
    "unjudged": {"rules": False},
    "formulas": {
        "formulas": {"untouched": "[] !collision_ego", "back": "[] (left_ego -> <>[0,4] !left_ego)"},
    },
}


class Swerving:
    """Drives ahead and swerves, whatever stands there."""

    def start(self, problem: Any) -> None:
        self._ticks = 0
        self._rate = problem.rate

    def act(self, observation: Any) -> tuple[float, float]:
        self._ticks += 1
        turn = 0.9 if self._ticks * 10 // int(self._rate) % 17 < 5 else -0.4
        return 0.5, turn + 0.1 * len(observation.others)


class Keeping:
    """Goes straight on, and waits while another car is near; decides for many trials in one call."""

    def start(self, problem: Any) -> None:
        """Nothing is needed."""

    def act(self, observation: Any) -> tuple[float, float]:
        x, y = observation.pose.x, observation.pose.y
        away = [(car.pose.x - x) ** 2 + (car.pose.y - y) ** 2 for car in observation.others]
        return (0.0 if min(away, default=1.0) < 0.64 else 0.4, 0.0)

    def start_batch(self, trials: Any, problems: Any) -> None:
        """Nothing is needed."""

    def act_batch(self, view: Any) -> Any:
        x, y = view.state.x, view.state.y
        away = (x[:, 1:] - x[:, :1]) ** 2 + (y[:, 1:] - y[:, :1]) ** 2
        speed = np.where((away < 0.64).any(axis=1), 0.0, 0.4)
        return np.stack([speed, np.zeros_like(speed)], axis=1)


def configuration(
    network: str, agents: tuple[str, ...], variant: str = "plain", seconds: float = SECONDS, **more: Any
) -> dict[str, Any]:
    """Return a configuration with one e-agent of each of the names in `agents`."""
    rows = [AGENTS[name] for name in agents]
    return {
        "version": 1,
        "problem_domain": "dubins_traffic",
        "network": NETWORKS[network],
        "e-agents": [
            {"type": kind, "name": f"agent{k}", "parameters": dict(given)} for k, (kind, given) in enumerate(rows)
        ],
        "number_trials": 1,
        "duration": seconds,
        "number_goals_bounds": [1, 3],
        "rules": True,
        **VARIANTS[variant],
        **more,
    }


def trial(document: Mapping[str, Any], controller: str, seed: int, folder: Path, *, shown: bool = False) -> Parts:
    """Run a trial; give its record, its score from the trial and from the record, and what a replay shows."""
    instance = dt.draw(dt.load_config(document), seed, 0)
    path = folder / "trial.mcap"
    result = dt.run_trial(instance, controller, record=path, overwrite=True)
    record = dt.load_record(path)
    yield "record", decoded_record(record)
    yield "score", decoded_score(result.score)
    assert decoded_score(dt.score(record)) == decoded_score(result.score)
    if shown:
        yield "replay", replay_data(record)
        export(record, folder / "trial.csv")
        yield "table", (folder / "trial.csv").read_bytes()


def batch(document: Mapping[str, Any], controller: str, seed: int, _folder: Path) -> Parts:
    """Score five trials in groups of three."""
    found = dt.run_batch(dt.load_config(document), controller, seed=seed, trials=5, batch=3)
    for k, score in enumerate(found.sheet.trials):
        yield f"score {k}", decoded_score(score)


def network(intersections: int, segments: int, seed: int, _folder: Path) -> Parts:
    """Generate a network."""
    made = dt.generate_network(intersections, segments, seed, rigid_motion=bool(seed % 2))
    yield "network", plain([made.segments, made.length, made.transform, made.shape])


def instance(document: str | Mapping[str, Any], seed: int, index: int, _folder: Path) -> Parts:
    """Draw an instance."""
    yield "instance", plain(dt.instance_to_document(dt.draw(dt.load_config(document), seed, index)))


def remote(document: Mapping[str, Any], seed: int, folder: Path) -> Parts:
    """Run a trial whose ego is driven over lines, in lockstep."""
    instance = dt.draw(dt.load_config(document), seed, 0)
    transport = Lines()
    link = Link(transport, Lockstep())
    try:
        with ThreadPoolExecutor(1) as pool:
            driven = pool.submit(drive, transport.address, Keeping())
            result = dt.run_trial(instance, record=folder / "trial.mcap", overwrite=True, link=link)
            link.close()
            driven.result(60)
    finally:
        link.close()
    yield "record", decoded_record(dt.load_record(folder / "trial.mcap"))
    yield "score", decoded_score(result.score)


def game(document: Mapping[str, Any], assumed: str | None, seed: int, _folder: Path) -> Parts:
    """Solve the game of cells; give the answer and its strategy or counterstrategy."""
    instance = dt.draw(dt.load_config(document), seed, 0)
    found = answer(instance, assumption=None if assumed is None else Assumption.parse(assumed.split(",")))
    told = found.to_json()
    yield "answer", plain({name: told[name] for name in told if name not in ("seconds", "memory_mib")})
    yield "winning", np.asarray(found.solution.winning).tobytes()
    for k, own in enumerate(found.solution.ranks):
        yield f"ranks {k}", b"".join(np.asarray(part).tobytes() for part in (own.rank, own.start, own.debt))


def exports(document: Mapping[str, Any], seed: int, _folder: Path) -> Parts:
    """Write the task in every format."""
    instance = dt.draw(dt.load_config(document), seed, 0)
    whole = task(instance.problem, instance.names)
    for name, write in FORMATS.items():
        try:
            yield name, write(whole, instance.problem.period).encode()
        except FormulaError as error:
            yield name, str(error).encode()


def campaign(text: str, folder: Path) -> Parts:
    """Run a campaign and give its table's rows, but for where its controllers ran, which is younger than the hashes."""
    (folder / "campaign.toml").write_text(text)
    status = command_line(
        ["campaign", "run", str(folder / "campaign.toml"), "-o", str(folder / "out"), "--workers", "1"]
    )
    assert status == 0
    table = parquet.read_table(folder / "out" / "results.parquet")
    for name in table.drop_columns("ran").column_names:
        yield name, plain(table.column(name).to_pylist())


CAMPAIGN = """
version = 0
seed = 3
trials = 3
controllers = ["lanes", "rules", "lanes+shield"]
configurations = ["demo", "town"]
[factors]
e_agents = [1, 2]
duration = [4]
"""


def cases() -> dict[str, Case]:
    """Return all cases by name."""
    return {**_agents(), **_controllers(), **_variants(), **_others()}


def _agents() -> dict[str, Case]:
    found: dict[str, Case] = {}
    for k, agent in enumerate(AGENTS):
        for where in NETWORKS:
            for controller in ("lanes", "rules"):
                document = configuration(where, (agent, "lawful-wander"))
                found[f"agent/{agent}/{where}/{controller}"] = partial(trial, document, controller, k)
    return found


def _controllers() -> dict[str, Case]:
    mixed = ("lawful-wander", "nemesis", "wander", "lawful-left")
    found: dict[str, Case] = {}
    for k, controller in enumerate(CONTROLLERS):
        for where in NETWORKS:
            document = configuration(where, mixed[: 2 if controller == "synthesized" else 4])
            label = controller.rpartition(":Sw")[2].replace("erving", "swerving")
            found[f"controller/{label}/{where}"] = partial(trial, document, controller, 100 + k, shown=True)
    return found


def _variants() -> dict[str, Case]:
    found: dict[str, Case] = {}
    for variant in VARIANTS:
        document = configuration("grid", ("lawful-wander", "lawful-places", "lawful-left"), variant)
        few = configuration("grid", ("lawful-wander",), variant)
        found[f"variant/{variant}/synthesized"] = partial(trial, few, "synthesized", 7)
        for controller in ("lanes", "rules", "rules+shield"):
            found[f"variant/{variant}/{controller}"] = partial(trial, document, controller, 7)
        egos = ("lanes", "rules", "lanes+shield", f"{__name__}:Swerving")
        for controller in (*egos, f"{__name__}:Keeping") if variant != "disturbed" else egos:
            found[f"batch/{variant}/{controller.rpartition(':')[2]}"] = partial(batch, document, controller, 11)
    old = [name for name in found if "/obstacles/" in name]
    return found | {name: partial(_not_refused, found[name]) for name in old}


def _not_refused(case: Case, folder: Path) -> Parts:
    """Give a case whose first obstacle leaves a goal no free exit, which is refused by now; cars drive as they did."""
    with patch.object(drawing, "check_obstructions"), patch.object(documents, "check_obstructions"):
        yield from case(folder)


def _others() -> dict[str, Case]:
    found: dict[str, Case] = {}
    for count in range(1, 11):
        found[f"network/{count}"] = partial(network, 2 + 5 * count, 2 + 6 * count, count)
    for name in ("demo", "town", *NETWORKS):
        for seed in range(4):
            document = name if name not in NETWORKS else configuration(name, ("lawful-loop", "parked"))
            found[f"instance/{name}/{seed}"] = partial(instance, document, seed, seed)
    for where in NETWORKS:
        document = configuration(where, ("lawful-wander", "wander"))
        found[f"remote/lines/{where}"] = partial(remote, document, 21)
        found[f"export/{where}"] = partial(exports, document, 22)
    for assumed in (None, "E1,E2,E3,E4,E6", "E1:any-order,E2,E3,E4,E5,E6", "E2,E6"):
        for cars in (1, 2):
            document = configuration("grid", ("lawful-wander", "nemesis")[:cars])
            found[f"game/{assumed or 'all'}/{cars}"] = partial(game, document, assumed, 31)
    found["campaign"] = partial(campaign, CAMPAIGN)
    return found
