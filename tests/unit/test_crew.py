"""What becomes of errands whose workers are lost, whoever the workers are."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import pytest

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.runs.crew import ALONE, Errand, Outcome, Processes, carry_out


@dataclass(frozen=True)
class Task:
    """An errand that gives its number; one that is told to end ends its process."""

    number: int
    status: int | None = None

    def run(self, cancelled: Callable[[], bool]) -> int:
        assert not cancelled()
        if self.status is not None:
            raise SystemExit(self.status)
        return self.number


class Fragile:
    """A crew that does what `deadly` says of the errands under way: all of them are lost, or none."""

    capacity = 2

    def __init__(self, deadly: Callable[[Sequence[Errand]], bool]) -> None:
        self._deadly, self._under_way = deadly, list[Errand]()
        self.tried = Counter[int]()

    def submit(self, errand: Errand) -> None:
        self._under_way.append(errand)
        self.tried[errand.number] += 1

    def wait(self) -> list[Outcome]:
        own, self._under_way = self._under_way, []
        lost = self._deadly(own)
        return [Outcome(errand, None if lost else errand.number) for errand in own]

    def close(self) -> None: ...


def test_each_errand_is_done_once_and_what_ends_its_process_is_named() -> None:
    crew = Fragile(lambda own: any(errand.number == 3 for errand in own))
    found = [(errand.number, what) for errand, what in carry_out(crew, map(Task, range(6)))]
    assert sorted(found, key=lambda pair: pair[0]) == [*((k, k) for k in range(3)), (3, None), (4, 4), (5, 5)]
    assert crew.tried[3] == 2 + ALONE


def test_a_lost_errand_is_run_alone_in_its_parts() -> None:
    crew = Fragile(lambda own: any(errand.number == 0 for errand in own))
    parts = {0: [Task(10), Task(11)]}
    done = carry_out(crew, map(Task, range(2)), losses=1, apart=lambda task: parts.get(task.number, [task]))
    assert [(task.number, what) for task, what in done] == [(10, 10), (11, 11), (1, 1)]


def test_nothing_is_started_any_more_where_all_is_in_vain() -> None:
    crew = Fragile(lambda _: True)
    done = list(carry_out(crew, map(Task, range(100)), losses=1, barren=3))
    assert [(task.number, what) for task, what in done] == [(0, None), (1, None), (2, None)]
    assert max(crew.tried) == 5


def test_processes_give_back_what_came_of_errands_and_tell_of_those_told_to_end() -> None:
    crew = Processes(1)
    try:
        found: dict[int, Any] = {task.number: what for task, what in carry_out(crew, map(Task, range(3)))}
        assert found == {0: 0, 1: 1, 2: 2}
        crew.submit(Task(3, status=7))
        with pytest.raises(DubinsTrafficError, match="told to end"):
            crew.wait()
    finally:
        crew.close()
