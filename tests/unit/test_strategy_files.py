"""Strategies in files: written and read again; what is damaged or claims too much is wrong input."""

from __future__ import annotations

import io
import json
import tracemalloc
import zipfile
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.strategy import Strategy
from tests.games import ALL, solved


def test_a_strategy_comes_back_from_its_file(tmp_path: Path) -> None:
    strategy = Strategy.of(solved(2, 2, 2, ALL, 3))
    strategy.save(tmp_path / "first.npz")
    again = Strategy.load(tmp_path / "first.npz")
    assert again.board == strategy.board
    for old, new in zip(strategy.ranks, again.ranks, strict=True):
        assert (old.rank == new.rank).all()
        assert (old.debt == new.debt).all()
    again.save(tmp_path / "second.npz")
    assert (tmp_path / "first.npz").read_bytes() == (tmp_path / "second.npz").read_bytes()


def test_files_that_are_no_strategies_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "some.npz"
    with pytest.raises(InputError, match="no such file"):
        Strategy.load(path)
    path.write_text("nonsense")
    with pytest.raises(InputError, match=r"can't be read as a strategy \(no NumPy archive"):
        Strategy.load(path)
    np.savez(path, rank_0=np.zeros(3))
    with pytest.raises(InputError, match="header"):
        Strategy.load(path)
    header = {"format": "dubins-traffic strategy", "version": 99}
    np.savez(path, header=np.frombuffer(json.dumps(header).encode(), dtype=np.uint8))
    with pytest.raises(InputError, match=r"unknown version: got 99; expected 2"):
        Strategy.load(path)
    Strategy.of(solved(2, 2, 1)).save(path, overwrite=True)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(InputError, match="can't be read as a strategy"):
        Strategy.load(path)


def saved(path: Path, **changes: Any) -> Path:
    """Write a strategy with other arrays, or with another header where `header` is a dict or a text."""
    Strategy.of(solved(2, 2, 1)).save(path, overwrite=True)
    with np.load(path, allow_pickle=False) as archive:
        arrays = dict(archive)
    header = changes.pop("header", {})
    text = header if isinstance(header, str) else json.dumps(json.loads(arrays["header"].tobytes()) | header)
    arrays["header"] = np.frombuffer(text.encode(), dtype=np.uint8)
    np.savez_compressed(path, **(arrays | changes))
    return path


COUNT = 140


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rank_0": np.full(COUNT, np.nan)}, r"rank_0: not an array of a strategy: got 'float64 \(140,\)'"),
        ({"rank_0": np.full(COUNT, -1)}, "rank_0: not an array"),
        ({"rank_0": np.full(COUNT, -1, dtype=np.int32)}, "a strategy that wins from nowhere"),
        ({"rank_0": np.full(COUNT, -2, dtype=np.int32)}, "rank_0: tables of another game"),
        ({"rank_1": np.zeros(COUNT - 1, dtype=np.int32)}, "rank_1: of another size: got 139; expected 140"),
        ({"rank_1": np.zeros((2, 70), dtype=np.int32)}, "rank_1: not an array"),
        ({"start_0": np.full(40, 99, dtype=np.int32)}, "start_0: tables of another game|debt_0: of another"),
        ({"header": {"cars": 10**18}}, "header.cars"),
        ({"header": {"cars": 12}}, "header.cars: no game"),
        ({"header": {"goals": 3}}, "header.goals"),
        ({"header": {"goals": [[0, 0], [0, 1.5]]}}, "header.goals"),
        ({"header": {"network": []}}, "header.network"),
        ({"header": {"assume": "E1"}}, "header.assume"),
        ({"header": {"order_degree": "1"}}, "header.order_degree"),
        ({"header": "[1, 2]"}, "the header of a strategy"),
        ({"header": "[" * 5_000 + "]" * 5_000}, "the header of a strategy"),
        ({"header": '{"a":' * 200_000 + "1" + "}" * 200_000}, "the header of a strategy"),
    ],
    ids=range(17),
)
def test_damaged_strategies_are_wrong_input(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as found:
        Strategy.load(saved(tmp_path / "some.npz", **changes))
    assert "some.npz" in str(found.value)


def test_arrays_are_refused_by_the_size_that_they_claim(tmp_path: Path) -> None:
    """A bomb of 1 GB and one row after another of 1e14: neither is read."""
    path = tmp_path / "bomb.npz"
    saved(path)
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("header.npy", members["header.npy"])
        with archive.open("rank_0.npy", "w", force_zip64=True) as stream:
            for _ in range(1 << 10):
                stream.write(bytes(1 << 20))
    begun = process_time()
    tracemalloc.start()
    with pytest.raises(InputError, match=r"bomb.npz: rank_0: too large: got '1073741824 bytes'"):
        Strategy.load(path)
    assert tracemalloc.get_traced_memory()[1] < 1 << 26
    tracemalloc.stop()
    huge = io.BytesIO()
    np.lib.format.write_array_header_1_0(huge, {"descr": "<i4", "fortran_order": False, "shape": (10**14,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("header.npy", members["header.npy"])
        archive.writestr("rank_0.npy", huge.getvalue())
    with pytest.raises(InputError, match=r"rank_0: not an array of a strategy: got 'int32 .100000000000000,.'"):
        Strategy.load(path)
    assert process_time() - begun < 60.0
