"""Gazebo for tests; `scripts/gazebo.sh` installs it."""

from __future__ import annotations

import os

import pytest

from dubins_traffic.errors import InputError
from dubins_traffic.simulators.gazebo.prefix import Installation, find


def installation() -> Installation:
    """Return the installation; skip the test, or fail it under CI, where there is none."""
    try:
        return find()
    except InputError as error:
        reason = f"scripts/gazebo.sh installs it: {error}"
        if os.environ.get("CI") == "true":
            pytest.fail(reason)
        pytest.skip(reason)
