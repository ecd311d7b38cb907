"""Files are written whole or not at all, whoever else writes them at the same time."""

import os
import pty
import stat
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.files import replace_file, write_text


def test_threads_that_write_one_file_do_not_take_each_others(tmp_path: Path) -> None:
    path, both = tmp_path / "file", Barrier(2)

    def write(text: str) -> None:
        def put(neighbour: Path) -> None:
            neighbour.write_text(text)
            both.wait(60)

        replace_file(path, put)

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(write, ("one", "other")))
    assert path.read_text() in ("one", "other")
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_one_and_what_it_leads_to_is_replaced(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    target, link = tmp_path / "there" / "target", tmp_path / "link"
    link.symlink_to(target)
    for text in ("new", "newer"):
        write_text(link, text)
        assert link.is_symlink()
        assert target.read_text() == text
    assert sorted(tmp_path.rglob("*")) == [link, target.parent, target]


def test_what_is_no_file_stays_what_it_is(tmp_path: Path) -> None:
    """As root a device was once replaced by a file."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_text)
        write_text(pipe, "through")
        assert read.result(60) == "through"
    assert stat.S_ISFIFO(pipe.stat().st_mode)
    terminal, other = pty.openpty()
    place = Path(os.ttyname(other))
    write_text(place, "shown")
    assert os.read(terminal, 100) == b"shown"
    assert stat.S_ISCHR(place.stat().st_mode)
    with pytest.raises(InputError, match=r"^/dev/full: can't be written \(No space left on device\)$"):
        write_text("/dev/full", "much")
    assert stat.S_ISCHR(Path("/dev/full").stat().st_mode)
