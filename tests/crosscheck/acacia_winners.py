"""A game of cells as TLSF: Acacia-Bonsai, with Spot, finds the winners that omega finds. `make test-all` runs this.

It is no part of `make test`, since Acacia-Bonsai wants Python 3.13 (`scripts/crosscheck-tools.sh acacia`).
"""

import pytest

from dubins_traffic.synthesis.specification import specification_text
from tests import foreign
from tests.crosscheck.test_formula_tools import asked

pytestmark = pytest.mark.tools


def test_winners_are_those_of_acacia() -> None:
    """A road with two dead ends, from where the trial starts; and the same if one of them must never be entered."""
    some = foreign.instance()
    text = specification_text(foreign.board_of(some), foreign.starts_of(some), ".tlsf")
    barred = text.replace("  ASSERT {\n", "  ASSERT {\n    !(ego_0 && (!ego_1));\n")
    assert barred != text
    assert asked("acacia", "acacia_tlsf.py", [text, barred]) == [True, False]
    assert asked("omega", "written_game.py", [text, barred]) == [True, False]
