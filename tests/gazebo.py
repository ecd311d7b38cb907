"""Gazebo for tests; `scripts/gazebo.sh` installs it."""

from __future__ import annotations

from dubins_traffic.errors import InputError
from dubins_traffic.gazebo.prefix import Installation, find
from tests.tools import need


def installation() -> Installation:
    """Return the installation; skip the test, or fail it under CI, where there is none."""
    need("")
    try:
        return find()
    except InputError as error:
        need(f"Gazebo ({error})", "scripts/gazebo.sh installs it")
        raise
