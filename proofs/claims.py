"""What is to be proved: obligations, and what came of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


class RefutedError(Exception):
    """An obligation does not hold: the message is a counterexample."""


@dataclass(frozen=True, slots=True)
class Obligation:
    """A lemma as it is proved.

    Attributes
    ----------
    name : str
        How it is called.
    says : str
        What it says, in a sentence.
    lemma : str
        The page that states it.
    code : tuple of str
        The functions of the package that it speaks of, which are run.
    covers : str
        For which bodies, segments and bounds it holds.
    prove : callable
        Proves it and returns the number of cases; raises `RefutedError`.
    """

    name: str
    says: str
    lemma: str
    code: tuple[str, ...]
    covers: str
    prove: Callable[[], int]
