"""The schedule of a campaign: keeps an engine busy, runs lost chunks again, finds trials that kill their worker."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator

from dubins_traffic.campaign import rows
from dubins_traffic.campaign.chunks import Chunk
from dubins_traffic.campaign.engines import Engine
from dubins_traffic.scoring.registry import columns

LOSSES = 2
"""A chunk that was lost this often with others beside it is run alone, trial by trial."""
LOSSES_ALONE = 2
"""A trial that was lost this often alone is given up as the cause."""
REASON = "the process that ran it ended, each time it was run"


def carry_out(engine: Engine[Chunk], chunks: Iterator[Chunk]) -> Iterator[tuple[Chunk, bytes]]:
    """Run `chunks` and yield each once, with its part of the table, in the order in which they are ready.

    At most the engine's capacity is under way. A lost chunk is run again. One that is lost repeatedly is run with
    nothing beside it, a trial at a time: a trial that still ends its process becomes a row that says so.
    """
    losses: Counter[int] = Counter()
    again: deque[Chunk] = deque()
    suspects: deque[Chunk] = deque()
    under_way = 0
    while True:
        while under_way < engine.capacity:
            chunk = again.popleft() if again else next(chunks, None)
            if chunk is None:
                break
            engine.submit(chunk)
            under_way += 1
        if not under_way:
            break
        for outcome in engine.wait():
            under_way -= 1
            chunk = outcome.chunk
            if outcome.part is not None:
                yield chunk, outcome.part
                continue
            losses[chunk.number] += 1
            (suspects if losses[chunk.number] >= LOSSES else again).append(chunk)
    for chunk in suspects:
        for number in range(chunk.number, chunk.end):
            trial = chunk.part(number, number + 1)
            yield trial, _alone(engine, trial)


def _alone(engine: Engine[Chunk], trial: Chunk) -> bytes:
    for _ in range(LOSSES_ALONE):
        engine.submit(trial)
        part = engine.wait()[0].part
        if part is not None:
            return part
    metrics = columns(trial.metrics)
    row = rows.failure(trial.number, rows.CRASHED, REASON, metrics)
    return rows.encoded(rows.columns([row], metrics), metrics)
