"""The middle of a right lane on a segment that bends, as pieces of paths: lines and short arcs."""

from __future__ import annotations

from typing import NamedTuple

from dubins_traffic.policies.lanes.turns import PIECE_ANGLE, Piece, advanced
from dubins_traffic.roads.network import RoadNetwork


class LanePiece(NamedTuple):
    """A piece of the middle of a right lane, from `begin` to `end` metres along the lane's road."""

    begin: float
    end: float
    piece: Piece


def lane_pieces(network: RoadNetwork, lane: int, w: float) -> list[LanePiece]:
    """Return the pieces of a lane of a segment that bends, one for each line and arc of its chain.

    `w` is half the width of a lane, metres. On an arc that turns left the right lane is longer than the road.
    """
    chains, s, back = network.chains, lane >> 1, bool(lane & 1)
    numbers = range(int(chains.first[s]), int(chains.first[s + 1]))
    pieces: list[LanePiece] = []
    done = 0.0
    for k in reversed(numbers) if back else numbers:
        place, way = (chains.end, -chains.end_tangent) if back else (chains.start, chains.tangent)
        (x, y), (c, sine) = place[k].tolist(), way[k].tolist()
        length, side, radius = (float(array[k]) for array in (chains.length, chains.side, chains.radius))
        bend = (-side if back else side) / radius if side else 0.0
        stretch = 1.0 + bend * w
        piece = Piece(x + w * sine, y - w * c, c, sine, length * stretch, bend / stretch)
        pieces.append(LanePiece(done, done + length, piece))
        done += length
    return pieces


def cut(pieces: list[LanePiece], begin: float, end: float) -> list[LanePiece]:
    """Return the pieces from `begin` to `end` metres along the road, arcs in short ones; one at least.

    Before its begin and beyond its end the first and the last line go on.
    """
    cut_off: list[LanePiece] = []
    for k, whole in enumerate(pieces):
        low = begin if k == 0 else max(begin, whole.begin)
        high = end if k == len(pieces) - 1 else min(end, whole.end)
        if high > low or (k == len(pieces) - 1 and not cut_off):
            cut_off += _parts(whole, low, high)
    return cut_off


def _parts(whole: LanePiece, low: float, high: float) -> list[LanePiece]:
    """Return the part of a piece from `low` to `high` metres along the road, in short arcs."""
    piece = whole.piece
    stretch = piece.length / (whole.end - whole.begin)
    count = int(abs(piece.bend) * stretch * (high - low) / PIECE_ANGLE) + 1
    step = (high - low) / count
    pieces: list[LanePiece] = []
    for k in range(count):
        first = low + k * step
        x, y, c, s = advanced(piece, stretch * (first - whole.begin))
        pieces.append(LanePiece(first, first + step, Piece(x, y, c, s, stretch * step, piece.bend)))
    return pieces
