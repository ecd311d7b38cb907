"""Accounts by invitation, teams, passwords, tokens of the API, and the log of what organisers did."""

from __future__ import annotations

import hashlib
import re
import secrets
import threading
import unicodedata
from collections.abc import Sequence
from functools import cache

from argon2 import PasswordHasher
from argon2.exceptions import InvalidHashError, VerificationError
from sqlalchemy import ColumnElement, or_, select, update
from sqlalchemy.orm import Session

from dubins_traffic.errors import DubinsTrafficError
from dubins_traffic.service.database import Database
from dubins_traffic.service.database_tables import Account, Act, Code, Competition, Team, Token

ORGANISER, PARTICIPANT = "organiser", "participant"
ROLES = (PARTICIPANT, ORGANISER)
SHORTEST_PASSWORD = 10
LONGEST_PASSWORD = 1000
LONGEST_NAME = 60
RESERVED = re.compile(r"removed \d+", re.IGNORECASE)
"""Names of accounts that have been removed: who had one could not be removed in turn."""
LOCAL = "workers beside the server"
"""Name of the token of workers that the server begins by itself."""
INVITATION_S = 30 * 86400.0
"""How long an invitation is good, seconds."""
RESET_S = 86400.0
"""How long a code for a new password is good, seconds."""


class WrongEntryError(DubinsTrafficError):
    """A form or a document of the API is filled in wrongly; the text says what and what was expected."""


def clean_name(name: str, what: str) -> str:
    """Return a name as it is kept: one line, normalised, of visible letters.

    WrongEntryError if nothing is left of it, it is too long, or it has signs that can't be seen.
    """
    name = " ".join(unicodedata.normalize("NFKC", name).split())
    if not 1 <= len(name) <= LONGEST_NAME or not name.isprintable():
        raise WrongEntryError(f"{what}: 1 to {LONGEST_NAME} visible letters")
    return name


def _checked_password(password: str) -> str:
    if not SHORTEST_PASSWORD <= len(password) <= LONGEST_PASSWORD:
        raise WrongEntryError(f"password: {SHORTEST_PASSWORD} to {LONGEST_PASSWORD} signs")
    return password


HASHES = threading.BoundedSemaphore(2)
"""So many passwords are hashed at once: each takes a processor and 64 MiB for a while."""


@cache
def _hasher() -> PasswordHasher:
    return PasswordHasher()


def hashed(password: str) -> str:
    """Return a new password as it is kept. It takes its time, so no writer does it: others wait for a writer.

    WrongEntryError if it is too short or too long.
    """
    with HASHES:
        return _hasher().hash(_checked_password(password))


@cache
def _nobody() -> str:
    """Return a hash that is verified where there is no account, so that the time tells nothing."""
    return _hasher().hash(secrets.token_hex(16))


def digest_of(secret: str) -> str:
    """Return the SHA-256 by which a code or token is kept; both have 256 random bits."""
    return hashlib.sha256(secret.encode()).hexdigest()


def invite(
    session: Session,
    role: str,
    team: Team | None,
    at: float,
    *,
    by: Account | None = None,
    organises: Competition | None = None,
) -> str:
    """Return a new code by which one person can register, for a team or for none yet; `by` is who invites.

    An organiser who registers by it organises one competition, or all if none is given.
    """
    code = secrets.token_urlsafe(32)
    session.add(
        Code(
            digest=digest_of(code),
            kind="invitation",
            role=role,
            team_id=team and team.id,
            competition_id=organises and organises.id,
            made_by=by and by.id,
            expires=at + INVITATION_S,
        )
    )
    return code


def invitations(
    session: Session, at: float, team_id: int | None = None, made_by: Account | None = None
) -> Sequence[Code]:
    """Return the invitations that are good: those to a team, those that somebody has made, or all."""
    query = select(Code).where(Code.kind == "invitation", Code.used.is_(None), Code.expires > at)
    if team_id is not None:
        query = query.where(Code.team_id == team_id)
    if made_by is not None:
        query = query.where(Code.made_by == made_by.id)
    return session.scalars(query.order_by(Code.id)).all()


def revoke_invitation(
    session: Session, number: int, at: float, team_id: int | None = None, made_by: Account | None = None
) -> None:
    """End one of `invitations`; WrongEntryError if there is none of this number."""
    code = next((one for one in invitations(session, at, team_id, made_by) if one.id == number), None)
    if code is None:
        raise WrongEntryError("invitation: unknown, used or expired")
    code.used = at


def _good(session: Session, code: str, kind: str, at: float) -> Code:
    query = select(Code).where(Code.digest == digest_of(code.strip()), Code.kind == kind)
    row = session.scalars(query).first()
    if row is None or row.used is not None or row.expires <= at:
        raise WrongEntryError("code: unknown, used or expired; ask the organiser for another")
    return row


def join(database: Database, code: str, name: str, password: str, team: str, at: float) -> Account:
    """Make the account of a person who was invited; `team` names the team to found, if the code is for none.

    WrongEntryError if the code is not good, or a name or the password is not.
    """
    with database.reading() as session:  # who has no code costs no hash
        _good(session, code, "invitation", at)
    kept = hashed(password)
    with database.writing() as session:
        return _register(session, code, name, kept, team, at)


def _register(session: Session, code: str, name: str, password: str, team: str, at: float) -> Account:
    invitation = _good(session, code, "invitation", at)
    invitation.used = at
    name = clean_name(name, "name")
    if RESERVED.fullmatch(name) or name.casefold() in map(str.casefold, session.scalars(select(Account.name))):
        raise WrongEntryError("name: taken")
    account = Account(
        name=name,
        password=password,
        role=invitation.role or PARTICIPANT,
        team_id=invitation.team_id,
        competition_id=invitation.competition_id,
        created=at,
    )
    session.add(account)
    session.flush()
    if account.team_id is None and team.strip():
        account.team_id = make_team(session, team, at).id
    return account


def make_team(session: Session, name: str, at: float) -> Team:
    """Make a new team; WrongEntryError if the name is taken or is none."""
    name = clean_name(name, "team")
    if name.casefold() in map(str.casefold, session.scalars(select(Team.name))):
        raise WrongEntryError("team: the name is taken; a team's members invite further ones")
    team = Team(name=name, created=at)
    session.add(team)
    session.flush()
    return team


def verified(session: Session, name: str, password: str) -> Account | None:
    """Return the account that a name and a password are of, else None."""
    wanted = " ".join(unicodedata.normalize("NFKC", name).split()).casefold()
    there = session.execute(select(Account.id, Account.name).where(Account.removed.is_(None))).all()
    account_id = next((number for number, known in there if known.casefold() == wanted), None)
    account = None if account_id is None else session.get(Account, account_id)
    try:
        with HASHES:
            _hasher().verify(_nobody() if account is None else account.password, password[:LONGEST_PASSWORD])
    except (VerificationError, InvalidHashError):
        return None
    return account


def offer_reset(session: Session, account: Account, at: float) -> str:
    """Return a code by which a person who has lost the password can choose another."""
    code = secrets.token_urlsafe(32)
    session.add(Code(digest=digest_of(code), kind="password", account_id=account.id, expires=at + RESET_S))
    return code


def reset(database: Database, code: str, password: str, at: float) -> Account:
    """Set a new password by a code; it ends all log-ins and tokens. WrongEntryError if the code is not good."""
    with database.reading() as session:
        _good(session, code, "password", at)
    kept = hashed(password)
    with database.writing() as session:
        account = session.get_one(Account, _good(session, code, "password", at).account_id)
        set_password(session, account, kept, at)
    return account


def set_password(session: Session, account: Account, password: str, at: float) -> None:
    """Set another password, `hashed`; log-ins with the old one end, and so do tokens and codes for a new one."""
    account.password = password
    account.epoch += 1
    for token in tokens(session, account):
        token.revoked = at
    _void(session, Code.account_id == account.id, at)


def _void(session: Session, which: ColumnElement[bool], at: float) -> None:
    """End codes that are good."""
    session.execute(update(Code).where(which, Code.used.is_(None)).values(used=at))


def leave(session: Session, account: Account, at: float) -> None:
    """Take a person out of the team; the team's submissions and what it won stay.

    Nobody joins by an invitation to the team that the person may know, or that the person has made.
    """
    known = Code.made_by == account.id
    if account.team_id is not None:
        known = or_(known, Code.team_id == account.team_id)
    _void(session, known, at)
    account.team_id = None


def remove(session: Session, account: Account, at: float) -> None:
    """Remove a person, who leaves the team: name, password and tokens go."""
    leave(session, account, at)
    _void(session, Code.account_id == account.id, at)
    for token in tokens(session, account):
        token.revoked = at
        token.name = "removed"
    account.name, account.password = f"removed {account.id}", "none"
    account.removed, account.role, account.competition_id = at, PARTICIPANT, None
    account.epoch += 1


def tokens(session: Session, account: Account) -> Sequence[Token]:
    """Return the tokens of an account that are good."""
    query = select(Token).where(Token.account_id == account.id, Token.revoked.is_(None))
    return session.scalars(query.order_by(Token.id)).all()


def new_token(session: Session, name: str, account: Account | None, at: float) -> str:
    """Return a new token of the API for an account, or without one for a worker; only its SHA-256 is kept."""
    token = secrets.token_urlsafe(32)
    owner = account and account.id
    session.add(Token(digest=digest_of(token), name=clean_name(name, "name"), account_id=owner, created=at))
    return token


def worker_tokens(session: Session) -> Sequence[Token]:
    """Return the tokens of workers on other machines that are good."""
    query = select(Token).where(Token.account_id.is_(None), Token.revoked.is_(None), Token.name != LOCAL)
    return session.scalars(query.order_by(Token.id)).all()


def token_of(session: Session, token: str) -> Token | None:
    """Return what is known of a token that is good, else None."""
    query = select(Token).where(Token.digest == digest_of(token), Token.revoked.is_(None))
    return session.scalars(query).first()


def note(session: Session, account: Account | None, act: str, subject: str, detail: str, at: float) -> None:
    """Add to the log what an organiser did, or without an account what the service did by itself."""
    session.add(Act(at=at, account_id=account and account.id, act=act, subject=subject, detail=detail))
