"""The kernels of the rules against the slow reference, in batches, under rigid motions, and interpreted."""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from dubins_traffic.cars.body import Car, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.propositions import NAMES
from tests.rules_reference import Reference
from tests.rules_scripts import KITE, STAR, TURNED_STAR, flags, instance, label, moved, on_lane, wander

GRID = RoadNetwork.grid(2, 3, 3.5)
BOX = Car(body=Rectangle(0.5, 0.26))


def _obstacles(network: RoadNetwork) -> tuple[DiscObstacle | PolygonObstacle, ...]:
    disc = on_lane(network, 0, 1.7, -0.4)
    corners = ((1.4, -0.7), (1.9, -0.2), (1.5, -0.1))
    return (
        DiscObstacle(disc[0], disc[1], 0.15),
        PolygonObstacle(tuple(on_lane(network, 3, *corner)[:2] for corner in corners)),
    )


@pytest.mark.parametrize("body", [Car(), BOX], ids=["disc", "rectangle"])
@pytest.mark.parametrize("network", [STAR, TURNED_STAR, KITE, GRID], ids=["star", "turned", "kite", "grid"])
def test_kernels_agree_with_the_reference(network: RoadNetwork, body: Car) -> None:
    seen: Counter[str] = Counter()
    for seed in range(4):
        obstacles = _obstacles(network) if seed % 2 else ()
        case = instance(network, 6, car=body, obstacles=obstacles)
        script = wander(network, 6, 500, seed, odd=seed > 1)
        found = label([case], [script])
        reference = Reference(case.problem, 6)
        for k, frame in enumerate(script):
            reference.frame(frame)
            for n, car in enumerate(reference.cars):
                facts = car.facts
                expected = {name for name in NAMES if facts[name]}
                got = flags([found[k]], n)[0]
                assert got == expected, (seed, k, n, got ^ expected)
                numbers = tuple(int(array[0, n]) for array in found[k][:4])
                assert numbers == (facts["segment"], facts["at"], facts["crosses"], facts["lane"]), (
                    seed,
                    k,
                    n,
                )
                seen.update(got)
    assert set(seen) >= set(NAMES) - {"forfeited", "breach3", "in_crossing", "overtaking", "blocked"}


def test_scripts_meet_every_proposition() -> None:
    seen: set[str] = set()
    for seed in range(6):
        found = label([instance(STAR, 6)], [wander(STAR, 6, 500, seed)])
        for n in range(6):
            seen |= set().union(*flags(found, n))
    assert seen == set(NAMES)


def test_a_batch_equals_its_trials_alone() -> None:
    networks = [STAR, KITE, GRID, STAR]
    cars = [6, 3, 8, 1]
    cases = [
        instance(network, count, car=BOX if b % 2 else None, obstacles=_obstacles(network) if b == 2 else ())
        for b, (network, count) in enumerate(zip(networks, cars, strict=True))
    ]
    scripts = [wander(network, count, 300, b) for b, (network, count) in enumerate(zip(networks, cars, strict=True))]
    together = label(cases, scripts)
    for b, (case, script) in enumerate(zip(cases, scripts, strict=True)):
        alone = label([case], [script])
        for one, all_ in zip(alone, together, strict=True):
            for mine, theirs in zip(one, all_, strict=True):
                assert (mine[0] == theirs[b, : cars[b]]).all()


@pytest.mark.parametrize("angle", [0.3, 1.5707963267948966, 2.9])
def test_a_rigid_motion_changes_nothing(angle: float) -> None:
    script = wander(STAR, 6, 400, 11)
    still = label([instance(STAR, 6)], [script])
    turned = RoadNetwork(STAR.segments, STAR.length, (5.0, -2.0, angle), STAR.shape)
    found = label([instance(turned, 6)], [moved(script, 5.0, -2.0, angle)])
    for before, after in zip(still, found, strict=True):
        for mine, theirs in zip(before, after, strict=True):
            assert (mine == theirs).all()


def test_the_order_of_cars_in_memory_does_not_matter_to_what_they_are() -> None:
    script = wander(STAR, 5, 300, 3)
    swapped = [[*frame[1:], frame[0]] for frame in script]
    first = label([instance(STAR, 5)], [script])
    second = label([instance(STAR, 5)], [swapped])
    for before, after in zip(first, second, strict=True):
        assert (np.roll(before.lane, -1, axis=1) == after.lane).all()
        assert (np.roll(before.segment, -1, axis=1) == after.segment).all()


def digest() -> str:
    """Return a hash of all labels of two scripts, for the comparison of compiled and interpreted kernels."""
    cases = [instance(STAR, 5, obstacles=_obstacles(STAR)), instance(KITE, 5, car=BOX)]
    found = label(cases, [wander(STAR, 5, 150, 1), wander(KITE, 5, 150, 2)])
    whole = hashlib.sha256()
    for labels in found:
        for array in labels:
            whole.update(array.tobytes())
    return whole.hexdigest()


def test_interpreted_kernels_give_the_same_bits() -> None:
    code = "from tests.property.test_rules_reference import digest; print(digest())"
    ran = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout.strip() == digest()
