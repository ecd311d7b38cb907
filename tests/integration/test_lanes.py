"""A sample of `experiments.lanes`, which shows the bar on 200 instances."""

import statistics

import pytest
from experiments.lanes import Drive, drive

SAMPLE = 20


@pytest.fixture(scope="module")
def rows() -> list[Drive]:
    return [drive(number, rounds=3, seconds=60.0) for number in range(SAMPLE)]


def test_lanes_never_leaves_the_road(rows: list[Drive]) -> None:
    assert [row.off_road for row in rows] == [0.0] * SAMPLE


def test_lanes_is_at_fault_in_no_collision(rows: list[Drive]) -> None:
    assert [row.at_fault for row in rows] == [0] * SAMPLE


def test_lanes_alone_makes_the_rounds_of_free_flow(rows: list[Drive]) -> None:
    assert [row.number for row in rows if row.rounds < 0.9 * row.free_rounds] == []
    assert all(row.free_rounds >= 3 for row in rows)


def test_lanes_gets_on_among_others(rows: list[Drive]) -> None:
    assert statistics.median(row.distance for row in rows) >= 0.5


def test_lanes_does_not_stand_while_the_way_is_free(rows: list[Drive]) -> None:
    assert [row.number for row in rows if row.stood_free >= 10.0] == []
