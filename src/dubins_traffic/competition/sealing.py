"""Secret seeds: drawn, encrypted on disk, committed to, and revealed.

In the folder of a competition ``sealed/PHASE.json`` holds the seeds encrypted (AES-256-GCM; the key is derived by
scrypt from a passphrase or the contents of a key file, which lies elsewhere), ``published/PHASE.commitment.json`` what
is published when the phase opens, and ``published/PHASE.seeds.txt`` what is revealed after it has closed.

The text whose SHA-256 is the commitment is what it says, so that `sha256sum` alone checks it: a heading, the phase,
the digest of its rules, a salt, and the seed of each trial on a line of its own.
"""

from __future__ import annotations

import base64
import contextlib
import hashlib
import json
import os
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from pydantic import Field

from dubins_traffic.errors import InputError, needs
from dubins_traffic.files import is_file, read_text, replace_file
from dubins_traffic.problem import limits
from dubins_traffic.problem.faults import Strict, parse
from dubins_traffic.problem.files import dumps, parse_json
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
    """The seeds of a phase with what hides them until they are revealed."""

    phase: str
    """Its name."""
    rules: str
    """`Phase.rules` when the seeds were drawn."""
    salt: str
    """32 random bytes as hexadecimal digits: nobody can try seeds against the commitment."""
    seeds: tuple[int, ...]
    """One a trial, in the order of their numbers."""

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
    """Return the seeds that a revealed text says; InputError if it is no such text, to the byte."""
    lines = text.split("\n")
    expected = f"{HEADING}, phase, rules, salt, and a seed a line"
    if len(lines) < 6 or lines[0] != HEADING or lines[-1]:
        raise InputError("not revealed seeds", file=file, expected=expected)
    pairs = [line.partition(" ") for line in lines[1:4]]
    head = {name: value for name, _, value in pairs}
    if list(head) != ["phase", "rules", "salt"]:
        raise InputError("not revealed seeds", file=file, value=lines[1:4], expected=expected)
    for name, rule in (("rules", _DIGEST), ("salt", _SALT)):
        if not rule.fullmatch(head[name]):
            raise InputError("wrong value", file=file, field=name, value=head[name], expected="64 hexadecimal digits")
    for k, line in enumerate(lines[4:-1]):
        if not _SEED.fullmatch(line) or int(line) >= limits.SEEDS:
            raise InputError(
                "not a seed", file=file, field=f"line {k + 5}", value=line, expected="an integer below 2**64"
            )
    return Seeds(head["phase"], head["rules"], head["salt"], tuple(map(int, lines[4:-1])))


def check_belong(seeds: Seeds, phase: Seeded, file: str | None = None) -> None:
    """Refuse seeds that are of another phase, or of one whose rules were others; InputError if they are."""
    if seeds.phase != phase.name:
        raise InputError("seeds of another phase", file=file, field="phase", value=seeds.phase, expected=phase.name)
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


SHORTEST_KEY = 12
"""Fewest bytes of a passphrase or a key file."""
COST = 1 << 15
"""N of scrypt: 32 MiB and some tenths of a second for each guess (r = 8, p = 1)."""
MOST_DRAWS = 20
"""So many seeds are tried for a trial that can't always be drawn, such as one of many cars on few roads."""
_BLOCK, _LANES = 8, 1
_MEMORY = 1 << 26

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Base64 = Annotated[str, Field(pattern=r"^[A-Za-z0-9+/]+={0,2}$", max_length=1 << 24)]


class Sealed(Strict):
    """What is on disk of secret seeds."""

    version: Literal[1]
    phase: str
    commitment: Digest
    cipher: Literal["scrypt-32768-8-1 aes-256-gcm"] = "scrypt-32768-8-1 aes-256-gcm"
    salt: Base64
    nonce: Base64
    sealed: Base64


class Published(Strict):
    """What is published of a phase with secret seeds when it opens."""

    version: Literal[1]
    title: str
    phase: str
    rules: Digest
    commitment: Digest
    published: str


def sealed_path(phase: Seeded) -> Path:
    """Return where the encrypted seeds of a phase lie."""
    return _folder(phase) / "sealed" / f"{phase.name}.json"


def commitment_path(phase: Seeded) -> Path:
    """Return where the published commitment of a phase lies."""
    return _folder(phase) / "published" / f"{phase.name}.commitment.json"


def revealed_path(phase: Seeded) -> Path:
    """Return where the revealed seeds of a phase lie."""
    return _folder(phase) / "published" / f"{phase.name}.seeds.txt"


def draw_seeds(phase: Seeded) -> Seeds:
    """Return new seeds for a phase, from the system's source of secrets, from which all its trials can be drawn.

    InputError if a trial can't be drawn from any of `MOST_DRAWS` seeds.
    """
    seeds = tuple(_drawable(phase, number) for number in phase.numbers)
    return Seeds(phase.name, phase.rules, secrets.token_hex(32), seeds)


def _drawable(phase: Seeded, number: int) -> int:
    for _ in range(MOST_DRAWS - 1):
        seed = secrets.randbits(64)
        with contextlib.suppress(InputError):
            phase.instance(number, seed)
            return seed
    seed = secrets.randbits(64)
    phase.instance(number, seed)
    return seed


def seal(phase: Seeded, key: bytes, seeds: Seeds | None = None, *, overwrite: bool = False) -> str:
    """Draw the secret seeds of a phase and write them, encrypted; return their commitment.

    Parameters
    ----------
    phase : Seeded
        Of a competition that has a folder.
    key : bytes
        Passphrase, or contents of a key file.
    seeds : Seeds, optional
        Instead of new ones.
    overwrite : bool
        Whether seeds that are there may be replaced; those whose commitment has been published never are.

    Raises
    ------
    InputError
        If the phase has no secret seeds, they are there, or they can't be written.
    MissingExtraError
        Without the extra `competition`.
    """
    _check_secret(phase)
    path = sealed_path(phase)
    if is_file(commitment_path(phase)):
        raise InputError("its commitment has been published", file=str(commitment_path(phase)))
    if is_file(path) and not overwrite:
        raise InputError("holds sealed seeds", file=str(path), expected="none; --overwrite draws others")
    seeds = seeds or draw_seeds(phase)
    check_belong(seeds, phase)
    salt, nonce = secrets.token_bytes(16), secrets.token_bytes(12)
    head = {"version": 1, "phase": phase.name, "commitment": seeds.commitment}
    hidden = cipher_of(key, salt).encrypt(nonce, seeds.text.encode(), _bound(head))
    texts = {name: _text(data) for name, data in (("salt", salt), ("nonce", nonce), ("sealed", hidden))}
    _write(path, dumps(Sealed.model_validate({**head, **texts}).model_dump()))
    return seeds.commitment


def unsealed(phase: Seeded, key: bytes) -> Seeds:
    """Return the secret seeds of a phase.

    Raises
    ------
    InputError
        If there are none, the key is another, or the file has been changed.
    MissingExtraError
        Without the extra `competition`.
    """
    path = sealed_path(phase)
    sealed_seeds = _sealed(phase)
    head = {"version": 1, "phase": sealed_seeds.phase, "commitment": sealed_seeds.commitment}
    cipher = cipher_of(key, _bytes(sealed_seeds.salt, path))
    nonce, hidden = _bytes(sealed_seeds.nonce, path), _bytes(sealed_seeds.sealed, path)
    from cryptography.exceptions import InvalidTag

    try:
        text = cipher.decrypt(nonce, hidden, _bound(head)).decode()
    except (InvalidTag, ValueError):
        raise InputError(
            "can't be decrypted: another passphrase or key, or the file has been changed", file=str(path)
        ) from None
    seeds = read_seeds(text, str(path))
    if seeds.commitment != sealed_seeds.commitment:
        raise InputError("the seeds are not those committed to", file=str(path), field="commitment")
    check_belong(seeds, phase, str(path))
    return seeds


def publish(phase: Seeded, title: str, now: datetime | None = None) -> Published:
    """Write the commitment of a phase for everybody to see, and return it; a second time it is the same.

    InputError if the seeds have not been sealed, another commitment has been published, or it can't be written.
    """
    sealed = _sealed(phase)
    path = commitment_path(phase)
    if is_file(path):
        published_before = read_published(path)
        if published_before.commitment != sealed.commitment:
            raise InputError(
                "another commitment has been published",
                file=str(path),
                field="commitment",
                value=published_before.commitment,
                expected=sealed.commitment,
            )
        return published_before
    made = Published(
        version=1,
        title=title,
        phase=phase.name,
        rules=phase.rules,
        commitment=sealed.commitment,
        published=(now or datetime.now(UTC)).isoformat(timespec="seconds"),
    )
    _write(path, dumps(made.model_dump()))
    return made


def reveal(phase: Seeded, key: bytes, now: datetime | None = None) -> Path:
    """Write the seeds of a phase that has closed for everybody to see; return where.

    InputError if the phase is not over, its commitment was never published or is another, or the key is wrong.
    """
    _check_secret(phase)
    if not phase.is_closed(now):
        raise InputError(
            "the phase has not closed",
            field=f"phases.{phase.name}.closes",
            value=phase.closes and phase.closes.isoformat(),
            expected="a time that is past",
        )
    if not is_file(commitment_path(phase)):
        raise InputError("no commitment has been published", file=str(commitment_path(phase)))
    seeds = unsealed(phase, key)
    check_revealed(seeds, phase, read_published(commitment_path(phase)).commitment)
    _write(revealed_path(phase), seeds.text)
    return revealed_path(phase)


def check_revealed(seeds: Seeds, phase: Seeded, commitment: str) -> None:
    """Refuse seeds that are not those of a phase that were committed to; InputError if they are not."""
    check_belong(seeds, phase)
    if seeds.commitment != commitment:
        raise InputError(
            "the seeds are not those that were committed to",
            field="commitment",
            value=seeds.commitment,
            expected=commitment,
        )


def secret_seeds(phase: Seeded, key: bytes | None) -> tuple[int, ...]:
    """Return the seeds of a phase that has secret ones: the revealed ones, else those that `key` decrypts.

    InputError if they are still secret and the key is missing or wrong.
    """
    if phase.folder is not None and is_file(revealed_path(phase)):
        path = revealed_path(phase)
        seeds = read_seeds(read_text(path), str(path))
        check_belong(seeds, phase, str(path))
        if is_file(commitment_path(phase)):
            check_revealed(seeds, phase, read_published(commitment_path(phase)).commitment)
        return seeds.seeds
    if key is None:
        raise InputError(
            "the seeds are secret",
            field=f"phases.{phase.name}",
            expected="a phase whose seeds are known, or the key",
        )
    return unsealed(phase, key).seeds


def read_published(path: Path) -> Published:
    """Return a published commitment; InputError if the file holds none."""
    return parse(Published, parse_json(read_text(path), str(path)), file=str(path))


def _sealed(phase: Seeded) -> Sealed:
    path = sealed_path(phase)
    _check_secret(phase)
    if not is_file(path):
        raise InputError(
            "no sealed seeds",
            file=str(path),
            expected="the file that `dubins-traffic competition seal` makes",
        )
    sealed = parse(Sealed, parse_json(read_text(path), str(path)), file=str(path))
    if sealed.phase != phase.name:
        raise InputError(
            "seeds of another phase", file=str(path), field="phase", value=sealed.phase, expected=phase.name
        )
    return sealed


def _check_secret(phase: Seeded) -> None:
    if not phase.secret:
        raise InputError(
            "its seeds are no secret",
            field=f"phases.{phase.name}.seed",
            expected='a phase with seed = "secret"',
        )


def _folder(phase: Seeded) -> Path:
    if phase.folder is None:
        raise InputError("a competition without a folder", field=f"phases.{phase.name}", expected="one that is a file")
    return phase.folder


def cipher_class() -> Any:
    """Return the class of the cipher; MissingExtraError without the extra `competition`."""
    with needs("sealed seeds", "competition"):
        from cryptography.hazmat.primitives.ciphers.aead import AESGCM
    return AESGCM


def cipher_of(key: bytes, salt: bytes) -> Any:
    """Return the cipher (AESGCM) whose key scrypt derives from a passphrase or key; MissingExtraError without it."""
    derived = hashlib.scrypt(checked_key(key), salt=salt, n=COST, r=_BLOCK, p=_LANES, maxmem=_MEMORY, dklen=32)
    return cipher_class()(derived)


def _bound(head: Mapping[str, object]) -> bytes:
    """Return what the ciphertext is bound to: another phase or commitment in the file is found out."""
    return json.dumps(head, sort_keys=True).encode()


def _text(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _bytes(text: str, path: Path) -> bytes:
    try:
        return base64.b64decode(text, validate=True)
    except ValueError:
        raise InputError("not Base64", file=str(path), value=text) from None


def _write(path: Path, text: str) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror})", file=str(path)) from None
    replace_file(path, lambda neighbour: neighbour.write_text(text, encoding="utf-8"), durable=True)


def make_key_file(path: Path, folder: Path | None) -> None:
    """Write a new key that only its owner may read; InputError as `read_key`, or if a file is there."""
    _check_outside(path, folder)
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise InputError(f"can't be written ({error.strerror})", file=str(path)) from None
    with os.fdopen(handle, "w", encoding="ascii") as file:
        file.write(secrets.token_hex(32) + "\n")


def read_key(path: Path, folder: Path | None) -> bytes:
    """Return what is in a key file.

    InputError if it can't be read, or lies in the folder of the competition: who copies that would have both.
    """
    _check_outside(path, folder)
    return read_text(path).strip().encode()


def _check_outside(path: Path, folder: Path | None) -> None:
    if folder is not None and path.resolve().is_relative_to(folder.resolve()):
        raise InputError("a key in the folder of what it locks", file=str(path), expected="a place outside it")


def checked_key(key: bytes) -> bytes:
    """Return a passphrase or key that is long enough; InputError if it is not."""
    if len(key) < SHORTEST_KEY:
        expected = f"at least {SHORTEST_KEY} bytes"
        raise InputError(
            "a key too short", field="passphrase or key file", value=f"{len(key)} bytes", expected=expected
        )
    return key
