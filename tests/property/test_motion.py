import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from dubins_traffic.cars import near
from dubins_traffic.cars.body import Bounds, Car, Disc, DiscObstacle, PolygonObstacle, Rectangle
from dubins_traffic.cars.state import State
from dubins_traffic.cars.tables import pack_obstacles
from dubins_traffic.kernels.boxes import NEVER, Box, Drive, box_contact, disc_contact, separation
from dubins_traffic.kernels.records import numbers
from dubins_traffic.kernels.trig import advance, sincos
from dubins_traffic.simulators.embedded import Embedded
from tests.batches import pose, scene

real = st.floats(-5, 5)
angle = st.floats(-3.2, 3.2)
speed = st.floats(-2, 2)
DT = 1 / 30


@settings(max_examples=300, deadline=None, derandomize=True)
@given(real, real, angle, speed, st.floats(-15, 15))
def test_two_half_arcs_equal_one(x, y, theta, u, w) -> None:
    start = (x, y, *sincos(theta))
    whole = advance(*start, u, w, DT)
    half = advance(*advance(*start, u, w, DT / 2), u, w, DT / 2)
    assert np.allclose(whole, half, rtol=0, atol=1e-14)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(real, real, angle, speed, st.floats(-15, 15))
def test_motion_agrees_with_an_integrator(x, y, theta, u, w) -> None:
    solution = solve_ivp(
        lambda _, q: [u * math.cos(q[2]), u * math.sin(q[2]), w],
        (0, DT),
        [x, y, theta],
        rtol=1e-12,
        atol=1e-13,
    )
    end = solution.y[:, -1]
    ours = advance(x, y, *sincos(theta), u, w, DT)
    assert np.allclose(ours, [end[0], end[1], math.cos(end[2]), math.sin(end[2])], rtol=0, atol=1e-9)


def sampled_gap(a, b, shape_a, shape_b, t):
    pa, pb = advance(*a, t), advance(*b, t)
    return separation(Box(*pa, *shape_a), Box(*pb, *shape_b))[0]


@st.composite
def movers(draw):
    a = (draw(real), draw(real), *sincos(draw(angle)), draw(st.floats(-40, 40)), draw(st.floats(-15, 15)))
    b = (draw(real), draw(real), *sincos(draw(angle)), draw(st.floats(-40, 40)), draw(st.floats(-15, 15)))
    return a, b


@settings(max_examples=400, deadline=None, derandomize=True)
@given(movers(), st.sampled_from(["disc", "box", "mixed"]))
def test_contact_is_the_first_zero_of_the_gap(pair, kind) -> None:
    a, b = pair
    shape_a = (0.0, 0.0, 0.3) if kind == "disc" else (0.4, 0.2, 0.0)
    shape_b = (0.4, 0.2, 0.0) if kind == "box" else (0.0, 0.0, 0.3)
    if sampled_gap(a, b, shape_a, shape_b, 0.0) < 1e-6:
        return
    meet = disc_contact if kind == "disc" else box_contact
    own, other = Box(*a[:4], *shape_a), Box(*b[:4], *shape_b)
    when = meet(own, Drive(*a[4:], NEVER), other, Drive(*b[4:], NEVER), 0.0, DT)
    times = np.linspace(0, min(when, DT), 400)
    gaps = [sampled_gap(a, b, shape_a, shape_b, t) for t in times]
    assert min(gaps) > -1e-9
    if when < NEVER:
        assert abs(gaps[-1]) <= 1.1e-9
        assert all(gap > 0 for gap in gaps[:-1])


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.integers(0, 2**32 - 1))
def test_cells_find_the_same_pairs_as_looking_at_all(seed) -> None:
    rng = np.random.default_rng(seed)
    n = 60
    state = State.zeros(1, n)
    state.x[0] = rng.uniform(-4, 4, n)
    state.y[0] = rng.uniform(-4, 4, n)
    found = []
    none = pack_obstacles([[]])
    search = near.search_tables(n, 4000)
    distance = rng.uniform(0.1, 1.5)
    count = near.candidates(0, distance, 0.1, state, none, search)
    found = {tuple(sorted(row)) for row in numbers(search.pair, np.int64)[:count].tolist()}
    assert len(found) == count
    gaps = np.hypot(state.x[0][:, None] - state.x[0], state.y[0][:, None] - state.y[0])
    true = {(i, j) for i in range(n) for j in range(i + 1, n) if gaps[i, j] < distance}
    assert found == true


def crowd(seed, body, cars=10, obstacles=True):
    rng = np.random.default_rng(seed)
    spots = rng.permutation(36)[:cars]
    starts = [pose((p % 6) * 1.1, (p // 6) * 1.1, rng.uniform(-3, 3)) for p in spots]
    things = []
    if obstacles:
        things = [DiscObstacle(-1.5, 2, 0.5), PolygonObstacle(((7, 0), (8, 1), (7.2, 3), (7.5, 1)))]
    return scene(starts, Car(body=body, bounds=Bounds(speed=3.0)), things)


def restless(rng, trials, cars, ticks):
    """Return commands that change every fifteen ticks, so that cars get somewhere."""
    phases = [rng.uniform(-1, 1, (trials, cars, 2)) * [3, 2] for _ in range(ticks // 15 + 1)]
    return [phases[k // 15].copy() for k in range(ticks)]


def play(instances, commands):
    simulator = Embedded()
    state = simulator.reset(instances)
    contacts = [[] for _ in instances]
    for command in commands:
        for b, found in enumerate(simulator.step(command.copy())):
            contacts[b] += found
    return state, contacts


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_bodies_never_overlap_in_a_crowd(body) -> None:
    rng = np.random.default_rng(7)
    box = (0, 0, body.radius) if isinstance(body, Disc) else (body.length / 2, body.width / 2, 0)
    touched = 0
    for seed in range(8):
        simulator = Embedded()
        state = simulator.reset([crowd(seed, body)])
        for command in restless(rng, 1, 10, 60):
            touched += len(simulator.step(command)[0])
            cars = np.stack([state.x[0], state.y[0], state.c[0], state.s[0]], axis=1)
            for i in range(10):
                for j in range(i + 1, 10):
                    assert separation(Box(*cars[i], *box), Box(*cars[j], *box))[0] > -3e-9
    assert touched > 10


@pytest.mark.parametrize("body", [Disc(), Rectangle(0.5, 0.3)])
def test_a_batch_equals_a_loop_of_singles_bit_for_bit(body) -> None:
    rng = np.random.default_rng(11)
    instances = [crowd(seed, body, cars=4 + seed, obstacles=seed % 2 == 0) for seed in range(5)]
    commands = restless(rng, 5, 8, 200)
    together, found = play(instances, commands)
    assert sum(len(contacts) for contacts in found) > 5
    for b, instance in enumerate(instances):
        n = len(instance.starts)
        alone, own = play([instance], [command[b : b + 1, :n] for command in commands])
        assert own[0] == found[b]
        for mine, batch in zip(alone[:6], together[:6], strict=True):
            assert mine[0].tobytes() == batch[b, :n].tobytes()


@settings(max_examples=20, deadline=None, derandomize=True)
@given(st.integers(0, 1000), st.floats(-3, 3), st.floats(-9, 9), st.floats(-9, 9))
def test_a_rigid_motion_commutes_with_the_simulation(seed, theta, tx, ty) -> None:
    rng = np.random.default_rng(seed)
    c, s = math.cos(theta), math.sin(theta)

    def carried(x, y):
        return c * x - s * y + tx, s * x + c * y + ty

    here = crowd(seed, Disc(), cars=6, obstacles=False)
    there = scene([pose(*carried(p.x, p.y), p.theta + theta) for p in here.starts], here.problem.car)
    commands = [rng.uniform(-1, 1, (1, 6, 2)) * [0.7, 3] for _ in range(20)]
    one, _ = play([here], commands)
    other, _ = play([there], commands)
    x, y = carried(one.x, one.y)
    assert np.allclose(x, other.x, rtol=0, atol=1e-9)
    assert np.allclose(y, other.y, rtol=0, atol=1e-9)
