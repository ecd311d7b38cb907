"""What a link takes for the answer to a frame, of drivers whose commands do not say which frame they answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from dubins_traffic.problem.instance import Instance
from dubins_traffic.protocols import End, Ending, Mailbox, View
from dubins_traffic.runs.single import run_trial
from dubins_traffic.transports.clocks import Lockstep, Patience
from dubins_traffic.transports.link import Link
from tests.recordings import make_instance


class Prompt:
    """A transport with a driver that answers each frame once: frame 0, shown before, as soon as it has the problem."""

    name = "prompt"
    tagged = False

    def open(self, mailbox: Mailbox) -> None:
        self.mailbox = mailbox

    def begin(self, instance: Instance, remote: Sequence[str]) -> None:  # noqa: ARG002  # any
        self.answered = -1

    def announce(self, instance: Instance) -> None:  # noqa: ARG002  # any
        self.answer(0)

    def frame(self, view: View) -> None:
        if view.running:
            self.answer(view.tick)

    def answer(self, tick: int) -> None:
        if tick > self.answered:
            self.answered = tick
            self.mailbox.command("ego", 0.3, 0.1)

    def end(self, ending: Ending) -> None:
        """Tell nobody."""

    def close(self) -> None:
        """There is nothing to close."""


def test_who_answers_frame_0_before_it_is_shown_again_has_answered_it() -> None:
    """Its command is not taken for one of before the announcement: it would not come again."""
    link = Link(Prompt(), Lockstep(600.0), patience=replace(Patience(), begin=1.0))
    result = run_trial(make_instance(names=(), ticks=30), link=link)
    assert (result.ending.end, result.ending.ticks) == (End.DURATION, 30)
