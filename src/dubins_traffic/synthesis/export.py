"""The game as an explicit graph in a file, for other people's tools.

A NumPy archive (`.npz`): `header`, JSON in UTF-8 bytes, and the arrays of `game.Game` with those that say what the
numbers of positions mean. `docs/theory.md` documents it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import numpy as np

from dubins_traffic.errors import InputError
from dubins_traffic.synthesis.archive import save_arrays
from dubins_traffic.synthesis.arrays import Numbers
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import Game
from dubins_traffic.synthesis.positions import list_scenes
from dubins_traffic.synthesis.queues import WHO

FORMAT: Final = "dubins-traffic game"
VERSION: Final = 2
WHO_NAMES: Final = ("e-agent", "ego", "e-agent that has forfeited")


def scene_numbers(board: Board) -> Numbers:
    """Return the scene (N, V) of each node in each position, numbered as in the header."""
    found = np.empty((board.positions, len(board.arena.nodes)), dtype=np.int32)
    room = np.empty(len(board.arena.nodes), dtype=np.int64)
    list_scenes(board.tables, room, found)
    return found


def header(board: Board) -> dict[str, Any]:
    """Return what the numbers in the file mean."""
    arena = board.arena
    kinds = list(board.sceneries)
    return {
        "format": FORMAT,
        "version": VERSION,
        "network": arena.network.to_document(),
        "goals": [list(arena.network.intersections[goal]) for goal in arena.goals],
        "order_degree": arena.order_degree,
        "cars": board.others,
        "assume": list(board.assumption.words()),
        "cells": [arena.name(cell) for cell in range(arena.cells)],
        "nodes": [
            {
                "inbound": [len(arena.nodes) + lane for lane in node.inbound],
                "exits": [len(arena.nodes) + lane for lane in node.exits],
                "kind": kinds.index(board.scenery(n).kind),
            }
            for n, node in enumerate(arena.nodes)
        ],
        "goal_nodes": [list(nodes) for nodes in arena.goal_nodes],
        "targets": [list(nodes) for nodes in arena.targets],
        "kinds": [
            [
                {
                    "inside": None if scene.inside is None else WHO_NAMES[scene.inside == WHO.EGO],
                    "queue": [[slot, WHO_NAMES[who]] for slot, who in scene.queue],
                    "parked": list(scene.parked),
                }
                for scene in board.sceneries[kind].scenes
            ]
            for kind in kinds
        ],
    }


def save_game(game: Game, path: str | Path, *, overwrite: bool = False) -> None:
    """Write a game to a file, as `save_arrays` does; InputError also if the game is lean."""
    if game.lean:
        raise InputError(
            "too large a game to be written",
            file=str(path),
            value=f"{game.moves} moves of the environment",
            expected="memory for all of them (--memory)",
        )
    arrays = {
        "scene": scene_numbers(game.board),
        "ego_cell": game.ego_cell,
        "to_at": game.to_at,
        "to": game.to,
        "ego_at": game.ego_at,
        "ego_to": game.ego_to,
        "owed_at": game.owed_at,
        "owed": game.owed,
    }
    save_arrays(path, header(game.board), arrays, overwrite=overwrite)
