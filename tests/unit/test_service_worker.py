"""What a worker answers for itself, and what the submission that it judges."""

from __future__ import annotations

from pathlib import Path

import pytest

from dubins_traffic.competition.submission import check_submission
from dubins_traffic.errors import InputError
from dubins_traffic.service.worker import lacks_room
from tests.disks import fill, small_disk

CONTROLLER = b"class Controller:\n    pass\n"


@pytest.mark.tools
def test_a_full_disk_is_the_worker_s_fault(tmp_path: Path) -> None:
    with small_disk(tmp_path / "disk", 1 << 10) as disk:
        fill(disk / "ballast")
        with pytest.raises(InputError, match="can't be stored") as found:
            check_submission(CONTROLLER, disk)
    assert lacks_room(found.value)


def test_what_is_no_submission_is_its_team_s_fault(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no class Controller") as found:
        check_submission(b"pass\n", tmp_path)
    assert not lacks_room(found.value)
