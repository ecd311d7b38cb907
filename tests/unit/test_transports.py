import math
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path

import pytest

from dubins_traffic.cars.state import Labels, State
from dubins_traffic.errors import InputError, MissingExtraError, TransportError
from dubins_traffic.kernels.trig import advance
from dubins_traffic.problem.kinds import kind_of
from dubins_traffic.protocols import End
from dubins_traffic.transports.clocks import Lockstep, RealTime
from dubins_traffic.transports.inbox import Inbox
from dubins_traffic.transports.lcm.connection import connect
from dubins_traffic.transports.link import between, kept, onward
from dubins_traffic.transports.maestro import Maestro, Mode, Next, Phase


def maestro(phase: Phase) -> Maestro:
    made = Maestro()
    made.enter(phase)
    return made


@pytest.mark.parametrize(
    ("phase", "mode", "granted", "following"),
    [
        (Phase.PREPARING, Mode.READY, None, None),
        (Phase.PREPARING, Mode.START, None, None),
        (Phase.PREPARING, Mode.RESET, None, None),
        (Phase.PREPARING, Mode.RESTART, None, None),
        (Phase.PREPARING, 77, False, None),
        (Phase.READY, Mode.READY, True, None),
        (Phase.READY, Mode.START, True, Next.RUN),
        (Phase.READY, Mode.RESET, True, Next.DRAW),
        (Phase.READY, Mode.RESTART, True, None),
        (Phase.READY, 77, False, None),
        (Phase.RUNNING, Mode.READY, False, None),
        (Phase.RUNNING, Mode.START, False, None),
        (Phase.RUNNING, Mode.RESET, True, Next.DRAW),
        (Phase.RUNNING, Mode.RESTART, True, Next.REPEAT),
    ],
)
def test_what_the_maestro_grants(phase: Phase, mode: int, granted: bool | None, following: Next | None) -> None:
    asked = maestro(phase)
    assert asked.answer(mode) is granted
    assert asked.next is following


def test_between_two_instances_every_request_waits_for_the_next_one() -> None:
    asked = maestro(Phase.RUNNING)
    assert asked.request(Mode.RESET)
    assert [asked.answer(mode) for mode in (Mode.READY, Mode.START)] == [None, None]
    with ThreadPoolExecutor(2) as pool:
        ready = pool.submit(asked.request, Mode.READY)
        asked.enter(Phase.PREPARING)
        start = pool.submit(lambda: (ready.result(), asked.request(Mode.START)))
        assert asked.next is Next.DRAW
        assert not wait([ready], 0.1).done
        asked.enter(Phase.READY)
        assert start.result(60) == (True, True)
    assert asked.next is Next.RUN


def test_who_waits_for_an_instance_is_refused_when_the_session_is_over() -> None:
    asked = maestro(Phase.PREPARING)
    with ThreadPoolExecutor(1) as pool:
        held = pool.submit(asked.request, Mode.START)
        assert not wait([held], 0.1).done
        asked.close()
        assert held.result(60) is False
    assert asked.request(Mode.READY) is False


def test_a_reset_right_after_start_waits_for_the_trial_it_ends() -> None:
    asked = maestro(Phase.READY)
    assert asked.request(Mode.START)
    assert asked.answer(Mode.RESET) is None
    asked.enter(Phase.RUNNING)
    assert asked.answer(Mode.RESET) is True


def test_two_programs_for_one_car_are_told_and_counted() -> None:
    inbox, told = Inbox(flood=50), list[str]()
    inbox.warn = told.append
    inbox.expect(["ego"])
    inbox.joined("ego")
    assert not told
    inbox.joined("ego")
    assert told == ["2 programs send commands for ego at once: the latest command counts"]
    inbox.left("ego")
    assert (inbox.slot("ego").peers, inbox.slot("ego").gone_since) == (2, None)
    inbox.expect(["ego"])
    assert inbox.slot("ego").peers == 1


def test_a_start_is_granted_once() -> None:
    asked = maestro(Phase.READY)
    assert [asked.request(Mode.START), asked.request(Mode.START), asked.request(Mode.READY)] == [
        True,
        False,
        False,
    ]


def test_only_what_ends_a_trial_interrupts_it() -> None:
    heard: list[str] = []
    asked = maestro(Phase.READY)
    asked.interrupt = heard.append
    asked.request(Mode.START)
    asked.enter(Phase.RUNNING)
    asked.request(Mode.RESET)
    assert heard == ["", "reset asked for"]


def test_an_inbox_keeps_one_command_a_car() -> None:
    inbox = Inbox(flood=50)
    inbox.expect(["ego"])
    for k in range(60):
        inbox.command("ego", float(k), 0.0)
        inbox.command("nobody", 1.0, 0.0)
    slot = inbox.slot("ego")
    assert (slot.speed, slot.commands, inbox.unknown) == (59.0, 60, 60)
    assert slot.fault is not None
    assert slot.fault[0] is End.PEER_FLOOD


def test_who_answers_many_frames_a_second_is_no_flood() -> None:
    inbox = Inbox(flood=50)
    inbox.expect(["ego"])
    for tick in range(200):
        inbox.stale()
        inbox.command("ego", 0.1, 0.0, tick)
    assert inbox.slot("ego").fault is None


def test_a_lost_transport_outlives_the_trial() -> None:
    inbox = Inbox(flood=50)
    inbox.stop(End.RESET, "reset")
    inbox.stop(End.TRANSPORT_LOST, "no master")
    inbox.expect(["ego"])
    assert inbox.stopped == (End.TRANSPORT_LOST, "no master")


def test_real_time_runs_at_its_factor_and_can_be_put_off() -> None:
    clock = RealTime(2.0)
    clock.start(0.1, 100.0)
    assert clock.due(10) == pytest.approx(100.5)
    clock.shift(3.0)
    assert clock.until(9, 0.0) == pytest.approx(103.5)


def test_lockstep_is_never_early() -> None:
    assert Lockstep(2.0).due(10**9) == -math.inf
    assert Lockstep(2.0).until(5, 10.0) == 12.0


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_clocks_refuse_what_is_no_time(bad: float) -> None:
    for clock in (Lockstep, RealTime):
        with pytest.raises(InputError, match="positive"):
            clock(bad)


def test_states_between_frames_lie_on_the_way() -> None:
    before, after = State.zeros(1, 1), State.zeros(1, 1)
    before.speed[:], before.yaw_rate[:] = 0.5, 0.9
    x, y, c, s = advance(0.0, 0.0, 1.0, 0.0, 0.5, 0.9, 1 / 30)
    after.x[:], after.y[:], after.c[:], after.s[:], after.speed[:] = x, y, c, s, 0.5
    middle = between(before, after, 0.5)
    exact = advance(0.0, 0.0, 1.0, 0.0, 0.5, 0.9, 1 / 60)
    for seen in (middle, onward(before, 1 / 60)):
        assert [float(row[0, 0]) for row in seen[:4]] == pytest.approx(exact, abs=1e-4)
    assert onward(before, 0.0) is before
    copy, _ = kept(before, Labels.zeros(1, 1))
    before.x[:] = 7.0
    assert copy.x[0, 0] == 0.0


def test_a_package_and_executable_that_is_not_ours_is_remote() -> None:
    assert [kind_of("wander/wander"), kind_of("my_pkg/node.py"), kind_of("remote")] == [
        "wander",
        "remote",
        "remote",
    ]
    with pytest.raises(InputError, match="package/executable"):
        kind_of("my pkg/node")


GONE = """
try:
    from ._lcm import LCM
except ImportError:
    from .Release import LCM
"""


def test_a_library_that_does_not_load_is_no_missing_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where GLib is missing, LCM's wheel asks for another module of its own: its extra was asked for, and was there."""
    monkeypatch.syspath_prepend(tmp_path)
    for name in [name for name in sys.modules if name.partition(".")[0] == "lcm"]:
        monkeypatch.delitem(sys.modules, name)
    (tmp_path / "lcm").mkdir()
    (tmp_path / "lcm" / "__init__.py").write_text(GONE)
    with pytest.raises(TransportError, match=r"does not load.*apt-get install libglib2\.0-0"):
        connect("udpm://239.255.76.67:7667?ttl=0")
    monkeypatch.setitem(sys.modules, "lcm", None)
    with pytest.raises(MissingExtraError, match="extra 'lcm'"):
        connect("udpm://239.255.76.67:7667?ttl=0")
