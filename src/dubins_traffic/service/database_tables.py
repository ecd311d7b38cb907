"""The tables of the service. Times are seconds since 1970, UTC; the rows of submissions and chunks are the queue."""

from __future__ import annotations

from typing import Any

from sqlalchemy import (
    JSON,
    Boolean,
    Double,
    ForeignKey,
    Index,
    Integer,
    LargeBinary,
    String,
    Text,
    UniqueConstraint,
)
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column, relationship


class Base(DeclarativeBase):
    """What all tables share."""

    type_annotation_map = {float: Double, dict[str, Any]: JSON, list[int]: JSON, list[Any]: JSON}  # noqa: RUF012


class Team(Base):
    """A team; `turn` counts the seconds of workers that it has had, by which the queue goes round the teams.

    `baseline` says that it is a built-in controller, which is shown apart.
    """

    __tablename__ = "team"
    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    created: Mapped[float]
    turn: Mapped[float] = mapped_column(default=0.0)
    baseline: Mapped[bool] = mapped_column(Boolean, default=False)
    accounts: Mapped[list[Account]] = relationship(back_populates="team")


class Account(Base):
    """A person. A removed account keeps its number, and nothing of the person; `epoch` ends older log-ins.

    `competition_id` is the one competition that an organiser organises, None for all.
    """

    __tablename__ = "account"
    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    password: Mapped[str] = mapped_column(Text)
    role: Mapped[str] = mapped_column(String(20))
    team_id: Mapped[int | None] = mapped_column(ForeignKey("team.id"))
    competition_id: Mapped[int | None] = mapped_column(ForeignKey("competition.id"))
    epoch: Mapped[int] = mapped_column(default=0)
    created: Mapped[float]
    removed: Mapped[float | None]
    team: Mapped[Team | None] = relationship(back_populates="accounts")
    competition: Mapped[Competition | None] = relationship(lazy="joined")


class Code(Base):
    """A code of an invitation or of a new password, by its SHA-256; it is good once, until it expires.

    `account_id` is whose password it is for, `made_by` who invites; `used` is also when it was revoked. The competition
    is that of an organiser of one.
    """

    __tablename__ = "code"
    id: Mapped[int] = mapped_column(primary_key=True)
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    kind: Mapped[str] = mapped_column(String(20))
    role: Mapped[str | None] = mapped_column(String(20))
    team_id: Mapped[int | None] = mapped_column(ForeignKey("team.id"))
    account_id: Mapped[int | None] = mapped_column(ForeignKey("account.id"))
    competition_id: Mapped[int | None] = mapped_column(ForeignKey("competition.id"))
    made_by: Mapped[int | None] = mapped_column(ForeignKey("account.id"))
    expires: Mapped[float]
    used: Mapped[float | None]


class Token(Base):
    """A token of the API, by its SHA-256: of an account, or of a worker."""

    __tablename__ = "token"
    id: Mapped[int] = mapped_column(primary_key=True)
    digest: Mapped[str] = mapped_column(String(64), unique=True)
    name: Mapped[str] = mapped_column(String(60))
    account_id: Mapped[int | None] = mapped_column(ForeignKey("account.id"))
    created: Mapped[float]
    revoked: Mapped[float | None]


class Competition(Base):
    """A competition: its file as it was given, sealed seeds and all."""

    __tablename__ = "competition"
    id: Mapped[int] = mapped_column(primary_key=True)
    slug: Mapped[str] = mapped_column(String(60), unique=True)
    title: Mapped[str] = mapped_column(Text)
    document: Mapped[str] = mapped_column(Text)
    created: Mapped[float]
    phases: Mapped[list[Phase]] = relationship(back_populates="competition", order_by="Phase.id")


class Announcement(Base):
    """What organisers tell everybody about a competition, in Markdown."""

    __tablename__ = "announcement"
    id: Mapped[int] = mapped_column(primary_key=True)
    competition_id: Mapped[int] = mapped_column(ForeignKey("competition.id"), index=True)
    at: Mapped[float]
    title: Mapped[str] = mapped_column(Text)
    text: Mapped[str] = mapped_column(Text)
    competition: Mapped[Competition] = relationship()


class Phase(Base):
    """A phase of a competition; `version` counts the changes of its results, of which `ranked` are in the table."""

    __tablename__ = "phase"
    id: Mapped[int] = mapped_column(primary_key=True)
    competition_id: Mapped[int] = mapped_column(ForeignKey("competition.id"))
    name: Mapped[str] = mapped_column(String(60))
    shows: Mapped[str] = mapped_column(String(20))
    opens: Mapped[float | None]
    closes: Mapped[float | None]
    commitment: Mapped[str | None] = mapped_column(String(64))
    revealed: Mapped[float | None]
    podium_checked: Mapped[bool] = mapped_column(Boolean, default=False)
    version: Mapped[int] = mapped_column(default=0)
    ranked: Mapped[int] = mapped_column(default=0)
    competition: Mapped[Competition] = relationship(back_populates="phases")
    __table_args__ = (UniqueConstraint("competition_id", "name"),)

    def is_open(self, at: float) -> bool:
        """Whether what is received at a time counts: before the closing second has begun."""
        return (self.opens is None or self.opens <= at) and not self.is_closed(at)

    def is_closed(self, at: float) -> bool:
        """Whether the phase is over at a time."""
        return self.closes is not None and at >= self.closes

    def left(self, at: float) -> float | None:
        """Return for how many seconds the phase is still open; None if it is not, or has no end."""
        return self.closes - at if self.closes is not None and self.is_open(at) else None


class Submission(Base):
    """A submission of a team to a phase.

    `run` counts how often it was judged anew, and results are of one run; `costs` says whether it counts for the quota,
    `named` whether the team has named it as the one that counts.
    """

    __tablename__ = "submission"
    id: Mapped[int] = mapped_column(primary_key=True)
    phase_id: Mapped[int] = mapped_column(ForeignKey("phase.id"))
    team_id: Mapped[int] = mapped_column(ForeignKey("team.id"))
    account_id: Mapped[int] = mapped_column(ForeignKey("account.id"))
    digest: Mapped[str] = mapped_column(String(64))
    filename: Mapped[str] = mapped_column(String(100))
    size: Mapped[int]
    state: Mapped[str] = mapped_column(String(20), index=True)
    reason: Mapped[str] = mapped_column(Text, default="")
    fault: Mapped[str] = mapped_column(String(20), default="")
    received: Mapped[float]
    changed: Mapped[float]
    deadline: Mapped[float]
    run: Mapped[int] = mapped_column(default=0)
    costs: Mapped[bool] = mapped_column(Boolean, default=True)
    named: Mapped[bool] = mapped_column(Boolean, default=False)
    disqualified: Mapped[str] = mapped_column(Text, default="")
    content: Mapped[str | None] = mapped_column(String(64))
    phase: Mapped[Phase] = relationship()
    team: Mapped[Team] = relationship()
    __table_args__ = (UniqueConstraint("phase_id", "team_id", "digest"),)


class Chunk(Base):
    """A unit of work: the check of a submission, some of its trials, or some of them again.

    `token` is the fencing token: it grows with every lease, and only the latest may report. `took` says how many
    seconds the lease lasted under which it was done.
    """

    __tablename__ = "chunk"
    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"), index=True)
    team_id: Mapped[int] = mapped_column(ForeignKey("team.id"))
    run: Mapped[int]
    kind: Mapped[str] = mapped_column(String(10))
    numbers: Mapped[list[int]]
    state: Mapped[str] = mapped_column(String(10))
    token: Mapped[int] = mapped_column(default=0)
    attempts: Mapped[int] = mapped_column(default=0)
    leased_at: Mapped[float | None]
    leased_until: Mapped[float | None]
    took: Mapped[float | None]
    worker: Mapped[str] = mapped_column(String(60), default="")
    note: Mapped[str] = mapped_column(Text, default="")
    submission: Mapped[Submission] = relationship()
    __table_args__ = (Index("chunk_waiting", "state", "team_id", "id"),)


class Trial(Base):
    """The result of a trial, and where the submission `ran`. `again` is the hash of its frames when it ran once more.

    In a phase that does not show all `hidden` holds it encrypted, and `log` too is (`service.hiding`). `own_replay` is
    a replay with the words of the controller, if it had any: its team sees that.
    """

    __tablename__ = "trial"
    id: Mapped[int] = mapped_column(primary_key=True)
    submission_id: Mapped[int] = mapped_column(ForeignKey("submission.id"))
    run: Mapped[int]
    number: Mapped[int]
    row: Mapped[dict[str, Any]] = mapped_column(default=dict)
    end: Mapped[str] = mapped_column(String(40), default="")
    owner: Mapped[str | None] = mapped_column(String(20))
    log: Mapped[str] = mapped_column(Text)
    frames: Mapped[str | None] = mapped_column(String(64))
    ran: Mapped[str | None] = mapped_column(String(20))
    again: Mapped[str | None] = mapped_column(String(64))
    replay: Mapped[str | None] = mapped_column(String(64))
    own_replay: Mapped[str | None] = mapped_column(String(64))
    hidden: Mapped[bytes | None] = mapped_column(LargeBinary)
    __table_args__ = (UniqueConstraint("submission_id", "run", "number"),)


class Standing(Base):
    """A table of places as it was at a time: the history of a leaderboard; `hidden` as that of a trial."""

    __tablename__ = "standing"
    id: Mapped[int] = mapped_column(primary_key=True)
    phase_id: Mapped[int] = mapped_column(ForeignKey("phase.id"), index=True)
    at: Mapped[float]
    version: Mapped[int]
    places: Mapped[list[Any]] = mapped_column(default=list)
    hidden: Mapped[bytes | None] = mapped_column(LargeBinary)


class Act(Base):
    """What an organiser did, or what was done for the competition; rows are added and never changed."""

    __tablename__ = "act"
    id: Mapped[int] = mapped_column(primary_key=True)
    at: Mapped[float]
    account_id: Mapped[int | None] = mapped_column(Integer)
    act: Mapped[str] = mapped_column(String(40))
    subject: Mapped[str] = mapped_column(Text)
    detail: Mapped[str] = mapped_column(Text, default="")


class Worker(Base):
    """A worker that has asked for work, and when it was last heard of."""

    __tablename__ = "worker"
    id: Mapped[int] = mapped_column(primary_key=True)
    name: Mapped[str] = mapped_column(String(60), unique=True)
    seen: Mapped[float]
    busy: Mapped[str] = mapped_column(Text, default="")
    limits: Mapped[str] = mapped_column(Text, default="")
