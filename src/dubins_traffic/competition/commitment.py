"""The seeds of a phase as a text whose SHA-256 is published before, and which is revealed after.

The text is what it says, so that `sha256sum` alone checks it: a heading, the phase, the digest of its rules, a salt,
and the seed of each trial on a line of its own.
"""

from __future__ import annotations

import hashlib
import re
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Protocol

from dubins_traffic.errors import InputError
from dubins_traffic.problem import limits
from dubins_traffic.problem.instance import Instance

HEADING = "dubins-traffic seeds 1"
_SALT = re.compile(r"[0-9a-f]{64}")
_DIGEST = re.compile(r"[0-9a-f]{64}")
_SEED = re.compile(r"0|[1-9][0-9]{0,19}")


class Seeded(Protocol):
    """A phase, as far as its seeds go (`competition.Phase`)."""

    @property
    def name(self) -> str:
        """Such as ``test``."""
        ...

    @property
    def rules(self) -> str:
        """SHA-256 of all that decides a trial and its rank, but for the seeds."""
        ...

    @property
    def numbers(self) -> range:
        """The numbers of its trials."""
        ...

    @property
    def folder(self) -> Path | None:
        """Where sealed and revealed seeds lie."""
        ...

    @property
    def secret(self) -> bool:
        """Whether its seeds are secret until it has closed."""
        ...

    @property
    def closes(self) -> datetime | None:
        """When it is over."""
        ...

    def instance(self, number: int, seed: int) -> Instance:
        """Return what a trial is drawn to be from its seed; InputError if it can't be drawn."""
        ...

    def is_closed(self, now: datetime | None = None) -> bool:
        """Tell whether it is over."""
        ...


@dataclass(frozen=True, slots=True)
class Seeds:
    """The seeds of a phase with what hides them until they are revealed.

    Attributes
    ----------
    phase : str
        Its name.
    rules : str
        `Phase.rules` when the seeds were drawn.
    salt : str
        32 random bytes as hexadecimal digits: nobody can try seeds against the commitment.
    seeds : tuple of int
        One a trial, in the order of their numbers.
    """

    phase: str
    rules: str
    salt: str
    seeds: tuple[int, ...]

    @property
    def text(self) -> str:
        """The text that is committed to, and later revealed."""
        head = [HEADING, f"phase {self.phase}", f"rules {self.rules}", f"salt {self.salt}"]
        return "\n".join([*head, *map(str, self.seeds), ""])

    @property
    def commitment(self) -> str:
        """SHA-256 of the text, as hexadecimal digits."""
        return hashlib.sha256(self.text.encode()).hexdigest()


def read_seeds(text: str, file: str | None = None) -> Seeds:
    """Return the seeds that a revealed text says.

    Raises
    ------
    InputError
        If it is no such text, to the byte.
    """
    lines = text.split("\n")
    expected = f"{HEADING}, phase, rules, salt, and a seed a line"
    if len(lines) < 6 or lines[0] != HEADING or lines[-1]:
        raise InputError("not revealed seeds", file=file, expected=expected)
    pairs = [line.partition(" ") for line in lines[1:4]]
    found = {name: value for name, _, value in pairs}
    if list(found) != ["phase", "rules", "salt"]:
        raise InputError("not revealed seeds", file=file, value=lines[1:4], expected=expected)
    for name, rule in (("rules", _DIGEST), ("salt", _SALT)):
        if not rule.fullmatch(found[name]):
            raise InputError(
                "wrong value", file=file, field=name, value=found[name], expected="64 hexadecimal digits"
            )
    for k, line in enumerate(lines[4:-1]):
        if not _SEED.fullmatch(line) or int(line) >= limits.SEEDS:
            raise InputError(
                "not a seed", file=file, field=f"line {k + 5}", value=line, expected="an integer below 2**64"
            )
    return Seeds(found["phase"], found["rules"], found["salt"], tuple(map(int, lines[4:-1])))


def check_belong(seeds: Seeds, phase: Seeded, file: str | None = None) -> None:
    """Refuse seeds that are of another phase, or of one whose rules were others.

    Raises
    ------
    InputError
        If they are.
    """
    if seeds.phase != phase.name:
        raise InputError(
            "seeds of another phase", file=file, field="phase", value=seeds.phase, expected=phase.name
        )
    if seeds.rules != phase.rules:
        raise InputError(
            "the seeds were drawn for other configurations, trials, limits or another ranking",
            file=file,
            field="rules",
            value=seeds.rules,
            expected=phase.rules,
        )
    if len(seeds.seeds) != len(phase.numbers):
        raise InputError(
            "not a seed for each trial",
            file=file,
            value=len(seeds.seeds),
            expected=f"{len(phase.numbers)} seeds",
        )
