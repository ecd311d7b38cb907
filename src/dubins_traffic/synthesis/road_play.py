"""The play of the game that a trial on the road amounts to, checked move by move.

A frame shows some cars. Who is farthest on in a cell holds it in the game; a car behind another one in the same cell,
or out of sight, has no place that the game could know, so one is assumed for it, out of the way, and revised as soon as
the road shows otherwise. The order of those who have not stopped yet at a crossing is assumed in the same way. What is
shown is never assumed: a car that is shown moves by moves of the game, or its move is unknown.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from dubins_traffic.cars.state import Labels, Pose, Propositions, State
from dubins_traffic.rules.propositions import FLAG, renews_ticket
from dubins_traffic.synthesis.assumption import Forfeits
from dubins_traffic.synthesis.board import Board
from dubins_traffic.synthesis.game import LARGEST_CHOICE, room
from dubins_traffic.synthesis.moves import Work, list_moves
from dubins_traffic.synthesis.queues import WHO, Scene
from dubins_traffic.synthesis.road_cells import RoadCells

WAITS: Final = FLAG.STOPPED | FLAG.FIRST | FLAG.FORFEITED
"""The flags that say where in the order a car is."""
NOWHERE: Final = -1
EVERYWHERE: Final = 1e9
"""A radius within which all cars are in view, metres."""


class Sighting(NamedTuple):
    """A car in a frame, as its driver or another sees it; `car` is 0 for the ego."""

    car: int
    pose: Pose
    propositions: Propositions


def sighted(b: int, n: int, state: State, labels: Labels) -> Sighting:
    """Return car `n` (index) in row `b` (index) of a batch."""
    pose = Pose(*(float(array[b, n]) for array in (state.x, state.y, state.c, state.s)))
    seen: Any = [int(array[b, n]) for array in labels]
    return Sighting(n, pose, Propositions(*seen))


class Ground:
    """The cells of a road network as places on the road."""

    def __init__(self, road_cells: RoadCells) -> None:
        network = road_cells.network
        self.road_cells = road_cells
        self._nodes = [road_cells.nodes_of(v) for v in range(len(network.intersections))]
        self._points: list[list[float]] = network.points.tolist()
        self._network = network
        self._tangents = [
            (sign * tx, sign * ty)
            for begins, ends in zip(network.tangents.tolist(), network.end_tangents.tolist(), strict=True)
            for (tx, ty), sign in ((begins, 1.0), (ends, -1.0))
        ]
        self._ends = [network.lane_ends(lane) for lane in range(network.lanes)]
        self._hulls = [self._hull(segment) for segment in range(len(network.segments))]
        self._beside: list[list[int]] = [[] for _ in range(road_cells.cells)]
        for cell in range(road_cells.cells):
            for other in road_cells.following(cell):
                self._beside[other].append(cell)
                self._beside[cell].append(other)

    def cell(self, before: int, pose: Pose, seen: Propositions) -> int:
        """Return the cell of a car that was in the cell `before`, NOWHERE if that is not known.

        A car is in an intersection while its body meets the disc, else in the lane of its lane state. But who goes to
        and fro over the edge of a bend or dead end has not moved: it holds the intersection until it is out in an exit,
        and that lane until it comes to another intersection.
        """
        count = len(self.road_cells.nodes)
        if seen.crosses < 0:
            came_in = 0 <= before < count and not self.road_cells.nodes[before].crossing
            if seen.lane < 0 or (came_in and seen.lane in self.road_cells.nodes[before].inbound):
                return before
            return count + seen.lane
        nodes = self._nodes[seen.crosses]
        here = [self.road_cells.nodes[node] for node in nodes]
        if any(before - count in node.exits and not node.crossing for node in here):
            return before
        if len(nodes) == 1 or before in nodes:
            return nodes[0] if len(nodes) == 1 else before
        if before >= count and self.road_cells.lane_end[before - count][0] in nodes:
            return self.road_cells.lane_end[before - count][0]
        return max(nodes, key=lambda node: self._fits(node, pose, seen))

    def _fits(self, node: int, pose: Pose, seen: Propositions) -> float:
        """Return how well a car that is first seen in a bend belongs into one of its nodes."""
        here = self.road_cells.nodes[node]
        if seen.lane >= 0 and (seen.lane in here.inbound or seen.lane in here.exits):
            return 2.0
        tx, ty = self._tangents[here.exits[0]]
        return tx * pose.c + ty * pose.s

    def along(self, cell: int, pose: Pose) -> float:
        """Return how far along its lane a car is, metres; 0 in intersections."""
        lane = cell - len(self.road_cells.nodes)
        if lane < 0:
            return 0.0
        x, y = self._points[self._ends[lane][0]]
        tx, ty = self._tangents[lane]
        if self._network.bent[lane >> 1]:
            return float(self._network.lane_coordinates(lane, (pose.x, pose.y))[0])
        return (pose.x - x) * tx + (pose.y - y) * ty

    def _hull(self, segment: int) -> list[list[float]]:
        """Return points whose convex hull holds a segment: its ends, and the corners between where it bends."""
        network = self.road_cells.network
        corners = [(x, y) for x, y, _ in network.corners[segment]] if network.corners else []
        ends = [self._points[v] for v in self._ends[2 * segment]]
        return [*ends, *network.to_world(corners).tolist()] if corners else ends

    def within(self, cell: int, pose: Pose, radius: float, margin: float) -> bool:
        """Say whether a car in a cell would be nearer to a pose than `radius`, wherever in the cell it is.

        Its centre is at most `margin` from the intersection, or in the lane between its ends.
        """
        count = len(self.road_cells.nodes)
        reach = radius - margin
        points = (
            [self._points[self.road_cells.nodes[cell].vertex]] if cell < count else self._hulls[(cell - count) >> 1]
        )
        return reach > 0.0 and all((x - pose.x) ** 2 + (y - pose.y) ** 2 < reach * reach for x, y in points)

    def nearest_free(self, cell: int, taken: Collection[int], avoided: Collection[int]) -> int:
        """Return the lane nearest to a cell that is not taken, nor to be avoided; if there is none, any free cell."""
        spare = [NOWHERE, NOWHERE]
        for near in self._by_distance(cell):
            if near in taken:
                continue
            if near >= len(self.road_cells.nodes) and near not in avoided:
                return near
            kind = 0 if near >= len(self.road_cells.nodes) else 1
            spare[kind] = near if spare[kind] == NOWHERE else spare[kind]
        return spare[0] if spare[0] != NOWHERE else spare[1]

    def _by_distance(self, cell: int) -> Iterable[int]:
        seen = {cell}
        waiting = deque([cell])
        while waiting:
            near = waiting.popleft()
            yield near
            for other in self._beside[near]:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)


EGO_CAR: Final = 0
NO_TICKET: Final = -1
UNKNOWN_MOVE: Final = "unknown_move"
NEW_TICKET: Final = "new_ticket"
"""Kinds of what is noted: a move that the game does not know; a place in the order given up, which the rules allow."""


@dataclass(frozen=True, slots=True)
class Sight:
    """How the road is seen."""

    sight: float
    """The ego sees the cars within this distance, metres."""
    margin: float
    """How far from an intersection a car in its disc may be, metres."""
    look: int
    """Ticks after which it is asked again where unseen cars may be."""
    assume_ego: bool = False
    """Whether a place is assumed for the ego, too, while it is behind another car in its cell."""

    @classmethod
    def of_all(cls, rate: float) -> Sight:
        """Return how the road is seen by who has all cars in view, at `rate` frames a second, Hz."""
        return cls(EVERYWHERE, 0.0, max(1, round(rate)), assume_ego=True)


class MoveList:
    """The moves of a board, listed on demand."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._work = Work.of(board)
        self._out = room(board, 1, LARGEST_CHOICE)

    def of_others(self, position: int) -> set[int]:
        """Return the positions that the environment may make of a position."""
        self._list(position)
        return set(self._out.to[: self._out.used[0].to].tolist())

    def of_ego(self, position: int) -> list[int]:
        """Return the positions that the ego may make of a position, that one first."""
        self._list(position)
        return self._out.ego_to[: self._out.used[0].ego_to].tolist()

    def _list(self, position: int) -> None:
        list_moves(self._board.tables, position, self._work, self._out)


class RoadPlay:
    """Follows a trial as a play of the game.

    Parameters
    ----------
    sight : Sight
        How the road is seen.

    Attributes
    ----------
    position : int or None
        Where the play is; None while the ego is behind another car in its cell and no place is assumed for it.
    cells : list of int
        Of all cars, the ego's first, shown or assumed.
    moves : MoveList
        What the game allows.
    noted : list of (str, str)
        Kind and detail of what the game does not know. The caller takes what is there.
    checked, revised, reordered : int
        How many moves have been looked up in the game, how often an assumed place has been changed, and how often a car
        has stopped before one that had come into its lane earlier.
    """

    def __init__(self, board: Board, sight: Sight, names: Sequence[str]) -> None:
        self.ground = Ground(board.road_cells)
        self.moves = MoveList(board)
        self.position: int | None = None
        self.cells = [NOWHERE] * (board.others + 1)
        self.noted: list[tuple[str, str]] = []
        self.checked = 0
        self.revised = 0
        self.reordered = 0
        self._board = board
        self._sight = sight
        self._names = names
        self._signature: object = None
        self._again = 0
        self._shown: dict[int, int] = {}
        self._seen: dict[int, Sighting] = {}
        self._queues: list[list[int]] = [[] for _ in board.road_cells.nodes]
        self._ticket = [NO_TICKET] * (board.others + 1)
        self._bits = [0] * (board.others + 1)

    @property
    def at_lanes_end(self) -> bool:
        """Whether the ego holds the end of a lane, so that it has to decide what to do before an intersection."""
        return self.position is not None and self.cells[EGO_CAR] >= len(self._board.road_cells.nodes)

    @property
    def is_crowded(self) -> bool:
        """Whether a car in view is behind another one in its cell, so that its place in the game is assumed."""
        return len(self._shown) < len(self._seen)

    def is_shown(self, car: int) -> bool:
        """Say whether a car (index) is in the cell that it has in the game."""
        return car in self._shown

    def follow(self, tick: int, cars: Sequence[Sighting]) -> bool:
        """Take in a frame, the ego first in `cars`; return whether anything has changed."""
        signature = [(car.car, *car.propositions[2:4], car.propositions.bits & WAITS) for car in cars]
        if signature == self._signature and tick < self._again:
            return False
        self._signature = signature
        self._seen = {car.car: car for car in cars}
        self._again = tick + self._sight.look
        cells = {car.car: self._cell(car) for car in cars}
        shown = self._holders(cells)
        self._assume(shown)
        self._note_crowds(shown, cells)
        self._play(shown)
        self._show(shown, cells)
        self._assume(shown)
        self._settle(tick)
        self.position = self._number()
        return True

    def _cell(self, car: Sighting) -> int:
        before = self.cells[car.car] if car.car in self._shown or car.car == EGO_CAR else NOWHERE
        return self.ground.cell(before, car.pose, car.propositions)

    def _holders(self, cells: dict[int, int]) -> dict[int, int]:
        """Return the cells of the cars that hold them: in each, who holds it already or is farthest on."""
        shown: dict[int, int] = {}
        holder: dict[int, int] = {}
        for car, cell in cells.items():
            if cell == NOWHERE:
                continue
            other = holder.get(cell)
            if other is None or self._is_before(car, other, cell):
                holder[cell] = car
        for cell, car in holder.items():
            shown[car] = cell
        return shown

    def _is_before(self, car: int, other: int, cell: int) -> bool:
        if cell < len(self._board.road_cells.nodes):
            return self._shown.get(car) == cell and self._shown.get(other) != cell
        along = self.ground.along
        return along(cell, self._seen[car].pose) > along(cell, self._seen[other].pose)

    def _note_crowds(self, shown: dict[int, int], cells: dict[int, int]) -> None:
        """Note who has gone where somebody is already: only through a bend one may follow another."""
        road_cells, nodes = self._board.road_cells, self._board.road_cells.nodes
        for car, cell in cells.items():
            entered = car in self._shown and car not in shown and self._shown[car] != cell != NOWHERE
            if entered and cell < len(nodes) and len(road_cells.nodes_of(nodes[cell].vertex)) == 1:
                self._note_move(car, self._shown[car], cell)

    def _assume(self, shown: dict[int, int]) -> None:
        """Find places for the cars that are not shown, where those that are shown have been and are not in the way."""
        now = set(shown.values())
        taken = set(self._shown.values()) | now
        if EGO_CAR not in shown and not self._sight.assume_ego:
            taken.add(self.cells[EGO_CAR])
        ego = self.cells[EGO_CAR]
        avoided = set(self._board.road_cells.following(ego)) if ego != NOWHERE else set[int]()
        for cell in tuple(avoided):
            avoided.update(self._board.road_cells.following(cell))
        nodes = len(self._board.road_cells.nodes)
        for car in range(0 if self._sight.assume_ego else 1, len(self.cells)):
            cell = self.cells[car]
            if car in self._shown and (car in shown or cell not in now):
                continue
            unseen = car not in self._seen
            if cell < nodes or cell in taken or (unseen and self._would_be_seen(cell)):
                cell = self._elsewhere(car, cell, taken, avoided)
                self._put(car, cell)
                self.revised += 1
            taken.add(cell)

    def _would_be_seen(self, cell: int) -> bool:
        return self.ground.within(cell, self._seen[EGO_CAR].pose, self._sight.sight, self._sight.margin)

    def _elsewhere(self, car: int, cell: int, taken: set[int], avoided: set[int]) -> int:
        start = max(cell, 0)
        if car in self._seen:
            return self.ground.nearest_free(start, taken, avoided)
        open_to_view = {other for other in range(self._board.road_cells.cells) if self._would_be_seen(other)}
        free_cell = self.ground.nearest_free(start, taken | open_to_view, avoided)
        return free_cell if free_cell != NOWHERE else self.ground.nearest_free(start, taken, avoided)

    def _put(self, car: int, cell: int) -> None:
        """Move a car, out of the queue it is in and last into the one it comes to."""
        nodes = len(self._board.road_cells.nodes)
        old = self.cells[car]
        if old >= nodes:
            queue = self._queues[self._board.road_cells.lane_end[old - nodes][0]]
            if car in queue:
                queue.remove(car)
        self.cells[car] = cell
        if cell >= nodes:
            self._queues[self._board.road_cells.lane_end[cell - nodes][0]].append(car)

    def _play(self, shown: dict[int, int]) -> None:
        """Make the moves of the cars that were shown and are, first those into free cells, of these e-agents first."""
        self.position = self._number()
        moved = [car for car in shown if self._shown.get(car, shown[car]) != shown[car]]
        pending = sorted(moved, key=lambda car: (car == EGO_CAR, car))
        while pending:
            car = next((car for car in pending if shown[car] not in self.cells), pending[0])
            pending.remove(car)
            self._move(car, shown[car])

    def _move(self, car: int, cell: int) -> None:
        """Make a move and look it up in the game."""
        before, old = self.position, self.cells[car]
        self._put(car, cell)
        self.position = self._number()
        self.checked += 1
        if before is None or self.position is None:
            known = before is None and cell in self._board.road_cells.following(old)
        elif car == EGO_CAR:
            known = self.position in self.moves.of_ego(before)
        else:
            known = self.position in self.moves.of_others(before)
        if not known:
            self._note_move(car, old, cell)

    def _note_move(self, car: int, old: int, cell: int) -> None:
        road_cells = self._board.road_cells
        self.noted.append((UNKNOWN_MOVE, f"{self._names[car]} from {road_cells.name(old)} to {road_cells.name(cell)}"))

    def _show(self, shown: dict[int, int], cells: dict[int, int]) -> None:
        """Put the cars that have come into view, and the ego if it is behind another, where they are."""
        for car, cell in shown.items():
            if self.cells[car] != cell or car not in self._shown:
                self._put(car, cell)
        if EGO_CAR not in shown and cells[EGO_CAR] != NOWHERE and not self._sight.assume_ego:
            self._put(EGO_CAR, cells[EGO_CAR])
        self._shown = shown

    def _settle(self, tick: int) -> None:
        """Bring all queues into the order of the road."""
        for car in range(len(self.cells)):
            self._update_ticket(car, tick)
        for queue in self._queues:
            if len(queue) > 1:
                place = {car: k for k, car in enumerate(queue)}
                queue.sort(key=lambda car: self._order(car, place[car]))
                shown = [place[car] for car in queue if car in self._shown]
                self.reordered += shown != sorted(shown)

    def _order(self, car: int, place: int) -> tuple[int, int, int]:
        if car not in self._shown:
            return (3, place, 0)
        if self._ticket[car] == NO_TICKET:
            return (2, place, 0)
        return (0 if self._bits[car] & FLAG.FIRST else 1, self._ticket[car], place)

    def _update_ticket(self, car: int, tick: int) -> None:
        seen = self._seen.get(car)
        bits = 0 if seen is None else seen.propositions.bits & WAITS
        before, self._bits[car] = self._bits[car], bits
        if not bits & FLAG.STOPPED:
            self._ticket[car] = NO_TICKET
        elif self._ticket[car] == NO_TICKET:
            self._ticket[car] = tick
        elif renews_ticket(before, bits):
            self._ticket[car] = tick
            self.noted.append((NEW_TICKET, f"{self._names[car]} in {self._board.road_cells.name(self.cells[car])}"))

    def _number(self) -> int | None:
        """Return the number of the position in which the cars are, None if there is none."""
        board, road_cells = self._board, self._board.road_cells
        nodes = len(road_cells.nodes)
        if NOWHERE in self.cells or len(set(self.cells)) < len(self.cells):
            return None
        inside = {cell: car for car, cell in enumerate(self.cells) if cell < nodes}
        scenes: list[Scene] = []
        for node, queue in enumerate(self._queues):
            occupant = inside.get(node)
            if occupant is None and not queue:
                scenes.append(EMPTY)
                continue
            scenes.append(self._scene(node, occupant, queue))
        try:
            return board.number(scenes)
        except KeyError:
            return None

    def _scene(self, node: int, inside: int | None, queue: Sequence[int]) -> Scene:
        road_cells = self._board.road_cells
        kind = self._board.scenery(node).kind
        nodes = len(road_cells.nodes)
        parked: list[int] = []
        waiting: list[tuple[int, int]] = []
        for car in queue:
            slot = road_cells.lane_end[self.cells[car] - nodes][1]
            if kind.parks and car != EGO_CAR and self._ticket[car] == NO_TICKET:
                parked.append(slot)
                continue
            renewed = kind.forfeits is Forfeits.ONCE and self._bits[car] & FLAG.FORFEITED
            waiting.append((slot, WHO.EGO if car == EGO_CAR else WHO.RENEWED if renewed else WHO.OTHER))
        return Scene(
            None if inside is None else WHO.EGO if inside == EGO_CAR else WHO.OTHER,
            tuple(waiting) if kind.ordered else tuple(sorted(waiting)),
            tuple(sorted(parked)),
        )


EMPTY: Final = Scene()
