"""The page of a running trial without a browser: who is let in, what pages are sent, and what a person may ask for."""

from __future__ import annotations

import time
from dataclasses import replace
from threading import Thread
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from dubins_traffic.cars.state import Labels, Propositions, State
from dubins_traffic.live import player
from dubins_traffic.live.access import Access, Door, RefusedError
from dubins_traffic.live.feed import FREE, turn_of
from dubins_traffic.live.player import LeftError, Player, Wheel
from dubins_traffic.live.playing import sentence, standings
from dubins_traffic.live.show import CHUNK, Show
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.draw import draw
from dubins_traffic.rules.propositions import FLAG
from dubins_traffic.runs.single import run_trial

PORT = 4711
HOST = f"127.0.0.1:{PORT}"


class Given:
    """The headers of a request."""

    def __init__(self, *pairs: tuple[str, str]) -> None:
        self._pairs = pairs

    def get_all(self, key: str, /) -> list[str]:
        return [value for name, value in self._pairs if name == key]


def cookie_of(access: Access) -> tuple[str, str]:
    return ("Cookie", access.cookie.partition(";")[0])


def refused(access: Access, target: str, *pairs: tuple[str, str]) -> int:
    with pytest.raises(RefusedError) as told:
        access.admit(target, Given(*pairs))
    return told.value.status


def test_the_token_is_exchanged_for_a_cookie_that_opens_page_and_socket() -> None:
    access = Access(PORT)
    host = ("Host", HOST)
    assert access.admit(f"/?token={access.token}", Given(host)) is Door.EXCHANGE
    assert access.admit("/", Given(host, cookie_of(access))) is Door.PAGE
    own = ("Origin", f"http://{HOST}")
    assert access.admit("/socket?show=1", Given(host, own, cookie_of(access))) is Door.SOCKET
    near = (("Host", f"localhost:{PORT}"), ("Origin", f"http://localhost:{PORT}"))
    assert access.admit("/socket?show=1", Given(*near, cookie_of(access))) is Door.SOCKET
    for part in ("HttpOnly", "SameSite=Strict", "Path=/"):
        assert part in access.cookie.split("; ")
    assert access.token not in access.cookie


def test_our_cookie_is_found_among_those_of_other_programs() -> None:
    access = Access(PORT)
    mixed = ("Cookie", f'other={{"a": "b; c"}}; {cookie_of(access)[1]}; x')
    assert access.admit("/", Given(("Host", HOST), mixed)) is Door.PAGE
    assert cookie_of(Access(PORT + 1))[1].partition("=")[0] != cookie_of(access)[1].partition("=")[0]


def test_a_token_for_once_opens_the_page_once() -> None:
    access = Access(PORT)
    once = access.token_for_once()
    assert access.admit(f"/?token={once}", Given(("Host", HOST))) is Door.EXCHANGE
    assert refused(access, f"/?token={once}", ("Host", HOST)) == 403
    assert access.admit(f"/?token={access.token}", Given(("Host", HOST))) is Door.EXCHANGE


@pytest.mark.parametrize(
    ("target", "host", "origin", "status"),
    [
        ("/", "evil.example:4711", None, 421),
        ("/", "127.0.0.1", None, 421),
        ("/", "127.0.0.1:80", None, 421),
        ("/", HOST, "http://evil.example", 403),
        ("/", HOST, "null", 403),
        ("/", HOST, f"https://{HOST}", 403),
        ("/socket", HOST, None, 403),
        ("/socket", HOST, f"http://localhost:{PORT}", 403),
        ("/other", HOST, None, 404),
        ("//evil.example/", HOST, None, 403),
    ],
)
def test_other_hosts_origins_and_paths_are_refused_even_with_the_cookie(
    target: str, host: str, origin: str | None, status: int
) -> None:
    access = Access(PORT)
    origins = () if origin is None else (("Origin", origin),)
    if target == "//evil.example/":  # another authority in the request changes nothing of who is let in
        assert refused(access, target, ("Host", host)) == status
    else:
        assert refused(access, target, ("Host", host), *origins, cookie_of(access)) == status


def test_two_hosts_or_none_and_wrong_secrets_are_refused() -> None:
    access = Access(PORT)
    assert refused(access, "/", cookie_of(access)) == 421
    assert refused(access, "/", ("Host", HOST), ("Host", HOST), cookie_of(access)) == 421
    assert refused(access, "/", ("Host", HOST)) == 403
    assert refused(access, "/?token=x", ("Host", HOST), cookie_of(access)) == 403
    assert refused(access, f"/?token={access.token}&token=x", ("Host", HOST)) == 403
    assert refused(access, f"/socket?token={access.token}", ("Host", HOST), ("Origin", f"http://{HOST}")) == 403
    name = cookie_of(access)[1].partition("=")[0]
    assert refused(access, "/", ("Host", HOST), ("Cookie", f"{name}=x")) == 403


def ticks_of(message: bytes, cars: int) -> list[int]:
    rows = np.frombuffer(message, "<u4").reshape(-1, 1 + 8 * cars)
    return rows[:, 0].tolist()


def test_a_show_leaves_no_tick_out_and_joins_those_in_a_row_in_bounded_messages() -> None:
    cars, count = 40, 1000
    show = Show(1, {})
    state, labels = State.zeros(1, cars), Labels.zeros(1, cars)
    for tick in range(1, count + 1):
        show.tick(tick, state, labels, np.zeros(2))
        if tick == 10:
            show.tell({"kind": "turn"})
    show.finish()
    place, is_all, messages = 0, False, list[bytes | str]()
    while not is_all:
        more, place, is_all = show.after(place)
        messages += more
    assert messages[1] == '{"kind":"turn"}'
    ticks = [tick for own in messages if isinstance(own, bytes) for tick in ticks_of(own, cars)]
    assert ticks == list(range(1, count + 1))
    assert max(len(own) for own in messages) <= CHUNK
    assert len(messages) < 10
    assert show.after(place) == ([], place, True)


def test_a_tick_tells_poses_relative_to_the_middle_and_labels() -> None:
    state, labels = State.zeros(1, 2), Labels.zeros(1, 2)
    state.x[0], state.y[0], state.c[0], state.s[0] = [3.0, 4.0], [1.0, 2.0], [0.0, 1.0], [1.0, 0.0]
    labels.bits[0] = [5, 1 << 30]
    show = Show(1, {})
    show.tick(7, state, labels, np.array([1.0, 1.0]))
    (message,), *_ = show.after(0)
    assert isinstance(message, bytes)
    assert ticks_of(message, 2) == [7]
    reals = np.frombuffer(message[4:44], "<f4").reshape(5, 2)
    assert reals[:2].tolist() == [[2.0, 3.0], [0.0, 1.0]]
    assert reals[2].tolist() == pytest.approx([np.pi / 2, 0.0])
    assert np.frombuffer(message[44:], "<i4").reshape(3, 2).tolist() == [[0, 0], [-1, -1], [5, 1 << 30]]


def seen(bits: int) -> Propositions:
    return Propositions(0, -1, -1, 0, bits)


def there(line: float = 0.3, *, before: tuple[str, ...] = (), inside: tuple[str, ...] = ()) -> Any:
    cars = [tuple(SimpleNamespace(name=name) for name in names) for names in (before, inside)]
    return SimpleNamespace(stop_line=line, crossing=True, before=cars[0], inside=cars[1])


def test_whose_turn_it_is_is_said_in_words() -> None:
    assert turn_of(seen(0), there(5.0)) == turn_of(seen(FLAG.STOPPED), there(0.0)) == FREE
    assert turn_of(seen(0), there()).state == "stop"
    waits = turn_of(seen(FLAG.STOPPED | FLAG.AHEAD), there(before=("car1", "bus")))
    assert (waits.state, waits.text) == ("wait", "Wait: car1, bus before you")
    assert turn_of(seen(FLAG.STOPPED), there(inside=("van",))).text == "Wait: van in the crossing"
    assert turn_of(seen(FLAG.STOPPED | FLAG.CLEAR), there()).state == "go"


def test_there_is_one_player_who_may_come_back() -> None:
    wheel = Wheel()
    assert wheel.take("a")
    assert not wheel.take("b")
    assert wheel.take("a")
    wheel.leave("a")
    wheel.leave("a")
    assert not wheel.take("b")
    assert wheel.take("a")
    wheel.hear({"drive": [1, -0.5]})
    wheel.wait()
    assert wheel.asked() == (1.0, -0.5)
    wheel.hear({"give_up": True})
    assert wheel.asked() is None


@pytest.mark.parametrize(
    "message",
    [
        {}, {"drive": [0.0]}, {"drive": [2, 0]}, {"drive": [0, float("nan")]}, {"drive": ["1", 0]}, {"drive": None},
        {"drive": [0, 0], "more": 1}, {"give_up": False}, {"give_up": 1, "x": 2}, [], 3, None, "drive",
    ],
)  # fmt: skip
def test_what_no_page_asks_for_is_refused(message: Any) -> None:
    with pytest.raises(ValueError, match="neither"):
        Wheel().hear(message)


def test_a_player_who_does_not_come_back_has_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(player, "PATIENCE", 0.2)
    wheel = Wheel()
    wheel.take("a")
    wheel.hear({"drive": [1, 0]})
    wheel.leave("a")
    Thread(target=lambda: (time.sleep(0.05), wheel.take("a"))).start()
    assert wheel.asked() == (0.0, 0.0)
    wheel.leave("a")
    with pytest.raises(LeftError):
        wheel.asked()
    assert wheel.left


def test_speed_and_yaw_rate_follow_what_is_asked_for_within_the_bounds() -> None:
    instance = draw(load_config("junction"), 0, 0)
    wheel = Wheel()
    person = Player(wheel)
    person.start(instance.problem)
    nothing: Any = None

    def after(seconds: float) -> Any:
        commands = [person.act(nothing) for _ in range(round(seconds * 30))]
        return commands[-1]

    wheel.take("a")
    wheel.hear({"drive": [1, 1]})
    assert 0.0 < after(1 / 30).speed < 0.1
    assert after(1.0) == (0.7, player.YAW_RATE)
    wheel.hear({"drive": [0, 0]})
    assert after(0.3) == (0.0, 0.0)
    wheel.hear({"drive": [-1, -1]})
    assert after(2.0) == (-0.7, -player.YAW_RATE)


def test_places_go_by_counted_rounds_and_then_by_those_before_a_breach() -> None:
    own = run_trial(draw(load_config("demo"), 0, 0), "simple", sketch=False).score
    ranks = {"play": (1, 1.0), "rules": (3, 3.0), "lanes": (1, 1.0), "simple": (0, 0.2)}
    scores = [
        replace(own, controller=name, counted_rounds=counted, rounds_before_breach=before)
        for name, (counted, before) in ranks.items()
    ]
    found = standings(scores)
    assert [(one.place, one.score.controller) for one in found] == [
        (1, "rules"), (2, "play"), (2, "lanes"), (4, "simple"),
    ]  # fmt: skip
    assert sentence(found) == "You came second of four, level with lanes."
