"""Finds the labels and contacts of a record again from its poses, whatever the record holds."""

from __future__ import annotations

from dataclasses import replace

from dubins_traffic.cars.state import EGO, Frames
from dubins_traffic.problem.instance import Instance
from dubins_traffic.problem.parts import Disturbances
from dubins_traffic.protocols import Ending
from dubins_traffic.record.reader import Record
from dubins_traffic.scoring.blocks import joined
from dubins_traffic.simulators.embedded import Embedded
from dubins_traffic.trial.trial import Trial
from dubins_traffic.verification.result import OURS
from dubins_traffic.verification.worlds import OVERLAP, FromPoses, Replayed, Shown, commands_of


def from_poses(record: Record) -> Record:
    """Return a record with the labels and contacts that follow from its poses and commands.

    In a world of ours every tick begins at its recorded frame and is moved by the recorded commands: what touches on
    the way is a contact. Bodies that overlap in a frame touch there, in any world, unless they have touched already.
    Contacts of a world that is not ours are kept beside these. What follows the end of the trial is left out.
    """
    if len(record.frames) < 2:
        return record
    frames = record.frames
    ours = record.instance.simulator == OURS
    world = FromPoses(frames, Embedded() if ours else Shown(frames), OVERLAP if ours else 0.0)
    instance = replace(record.instance, disturbances=Disturbances())
    kept = _Kept()
    others = Replayed(frames, range(1, len(instance.names)))
    trial = Trial(instance, simulator=world, agents=[others], sinks=[kept])
    rows: list[list[float]] = commands_of(frames)[:, EGO].tolist()
    for speed, yaw_rate in rows:
        if trial.ending is not None:
            break
        trial.advance((speed, yaw_rate))
    trial.close()
    found = replace(joined(kept.blocks), events=frames.events)
    return replace(record, frames=found, blocks=(found,))


class _Kept:
    """A sink that keeps all frames."""

    def begin(self, instance: Instance) -> None:  # noqa: ARG002  # all frames are kept alike
        """Do nothing: no frame has come yet."""
        self.blocks: list[Frames] = []

    def frames(self, frames: Frames) -> None:
        """Keep a block."""
        self.blocks.append(frames)

    def end(self, ending: Ending) -> None:
        """Do nothing."""
