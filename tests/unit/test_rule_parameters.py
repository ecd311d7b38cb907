"""The parameters of the rules, durations in ticks, names of flags and labels as words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dubins_traffic.errors import InputError, RecordError
from dubins_traffic.problem.configuration import load_config
from dubins_traffic.problem.document import instance_from_document, instance_to_document
from dubins_traffic.problem.draw import draw
from dubins_traffic.record.header import decode, encode
from dubins_traffic.roads.network import RoadNetwork
from dubins_traffic.rules.parameters import EDITION, RuleParameters
from dubins_traffic.rules.propositions import NAMES, names
from dubins_traffic.rules.tables import ticks
from dubins_traffic.transports.labels import words


def test_defaults_are_those_of_the_rules() -> None:
    own = RuleParameters()
    assert (own.crossing_degree, own.turn_back, own.left_set, own.left_release) == (3, 0.3, 0.05, 0.0)
    assert (own.stop_time, own.group_time, own.forfeit_time, own.stand_time) == (0.5, 0.1, 3.0, 1.0)
    assert RuleParameters.from_mapping({}) == own
    assert RuleParameters.from_mapping(own.to_mapping()) == own


def test_a_mapping_changes_what_it_names() -> None:
    own = RuleParameters.from_mapping({"turn_back": 0.4, "tickets": 2})
    assert (own.turn_back, own.tickets, own.stop_time) == (0.4, 2, 0.5)


@pytest.mark.parametrize(
    ("rules", "field"),
    [
        ({"turnback": 0.3}, "turnback"),
        ({"turn_back": -0.1}, "turn_back"),
        ({"turn_back": float("nan")}, "turn_back"),
        ({"turn_back": float("inf")}, "turn_back"),
        ({"turn_back": "0.3"}, "turn_back"),
        ({"turn_back": True}, "turn_back"),
        ({"crossing_degree": 3.0}, "crossing_degree"),
        ({"left_release": 0.1}, "left_release"),
        ({"approach_distance": 2.0}, "queue_distance"),
        ({"queue_distance": 0.4}, "queue_distance"),
        ({"overtaking_ahead": 1.4}, "overtaking_ahead"),
        ({"way_distance": 1.4}, "way_distance"),
        ({"stand_time": 0.4}, "stand_time"),
        ({"journey_start_time": 61.0}, "journey_start_time"),
        ({"rest_time": 10.0}, "journey_start_time"),
        ({"approach_distance": 0.0}, "approach_distance"),
        ({"enter_time": 0.0}, "enter_time"),
        ({"forfeit_time": 0}, "forfeit_time"),
        ({"edition": 1}, "edition"),
        ({"edition": 4}, "edition"),
        ({"edition": 3.0}, "edition"),
        ({"edition": True}, "edition"),
        ({"edition": EDITION, "turnback": 0.3}, "turnback"),
    ],
)
def test_bad_parameters_are_refused_by_name(rules: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError) as caught:
        RuleParameters.from_mapping(rules)
    assert caught.value.field == field
    assert caught.value.expected


def test_lengths_left_out_grow_with_the_lanes() -> None:
    town = {**load_config("town").to_document(), "rules": {"turn_back": 0.4}}
    town["car"] = {**town["car"], "w": 0.33}
    own, usual = draw(load_config(town), 0, 0).problem.rules, RuleParameters()
    assert own["way_distance"] == pytest.approx(1.1 * usual.way_distance)
    assert own["still_speed"] == pytest.approx(1.1 * usual.still_speed)
    assert (own["turn_back"], own["rest_time"], own["gap_rounds"]) == (0.4, usual.rest_time, usual.gap_rounds)
    assert own.keys() == usual.to_mapping().keys()
    assert RuleParameters.for_width(0.3) == usual


@pytest.mark.parametrize(
    ("duration", "rate", "expected"),
    [(0.5, 30.0, 15), (0.1, 30.0, 3), (0.1, 10.0, 1), (1.0, 30.0, 30),
     (0.0, 30.0, 0), (0.101, 10.0, 2), (3.0, 7.0, 21)],
)  # fmt: skip
def test_a_duration_is_so_many_ticks(duration: float, rate: float, expected: int) -> None:
    assert ticks(duration, rate) == expected


def test_a_problem_names_the_edition_of_its_rules() -> None:
    assert (EDITION, RuleParameters().to_mapping()["edition"]) == (3, 3)
    document = {**load_config("town").to_document(), "rules": True}
    instance = draw(load_config(document), 0, 0)
    assert instance.problem.rules["edition"] == EDITION
    written = instance_to_document(instance)
    assert written["rules"]["edition"] == EDITION
    assert instance_from_document(written).problem.rules == instance.problem.rules
    for named in (1, 2, 4):
        with pytest.raises(InputError, match="another edition of the rules of the road") as caught:
            instance_from_document({**written, "rules": {**written["rules"], "edition": named}})
        assert (caught.value.field, caught.value.value) == ("rules.edition", named)
        with pytest.raises(InputError, match="another edition"):
            load_config({**document, "rules": {"edition": named}})
        header = encode(instance, "rules").replace(b'"edition":3', b'"edition":%d' % named)
        with pytest.raises(RecordError, match=r"instance\.rules\.edition: another edition"):
            decode(header)
    assert decode(encode(instance, "rules")).instance.problem.rules["edition"] == EDITION


def test_flags_are_distinct_and_named() -> None:
    assert sorted(NAMES.values()) == [1 << k for k in range(len(NAMES))]
    assert names(0) == ()
    assert names(NAMES["left"] | NAMES["on_road"]) == ("on_road", "left")


def test_labels_are_words_as_in_2016() -> None:
    roads = RoadNetwork.grid(3, 4)
    segment, at = np.array([0, 3]), np.array([-1, roads.vertex((1, 0))])
    x0, y0, x1, y1 = roads.segments[3]
    assert words(roads, ("ego", "agent0"), segment, at) == (
        "ego_s_0_0_1_0",
        f"agent0_s_{x0}_{y0}_{x1}_{y1}",
        "agent0_t_1_0",
    )
