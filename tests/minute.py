"""Shipped configurations cut to a minute, for tests that need no more."""

from __future__ import annotations

from dubins_traffic.problem.configuration import Configuration, load_config


def a_minute(name: str) -> Configuration:
    """Return a shipped configuration of version 1 with trials of 60 s, and its goals anywhere on the network."""
    own = load_config(name)
    return own if own.version == 0 else load_config({**own.document, "duration": 60, "goal_segments_apart": 1})
