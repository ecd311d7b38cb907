"""The tables as `service.database_tables` states them; the database itself keeps the log of acts from changes."""

from __future__ import annotations

from alembic import op

from dubins_traffic.service.database_tables import Base

revision = "0001"
down_revision = None
branch_labels = None
depends_on = None
KEPT = "the log of acts only grows"


def upgrade() -> None:
    """Make the tables of this version from those of the version before."""
    # Until a version is released nobody has older tables. The first version after that states here what it found.
    Base.metadata.create_all(op.get_bind())
    if op.get_bind().dialect.name == "sqlite":
        for what in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER act_no_{what.lower()} BEFORE {what} ON act BEGIN SELECT RAISE(ABORT, '{KEPT}'); END"
            )
        op.execute(  # INSERT OR REPLACE deletes a row, and no trigger of DELETE is asked
            "CREATE TRIGGER act_no_replace BEFORE INSERT ON act WHEN EXISTS (SELECT 1 FROM act WHERE id = NEW.id) "
            f"BEGIN SELECT RAISE(ABORT, '{KEPT}'); END"
        )
    else:
        op.execute(
            f"CREATE FUNCTION act_is_kept() RETURNS trigger LANGUAGE plpgsql AS $$BEGIN RAISE EXCEPTION '{KEPT}'; END$$"
        )
        op.execute(
            "CREATE TRIGGER act_kept BEFORE UPDATE OR DELETE OR TRUNCATE ON act "
            "FOR EACH STATEMENT EXECUTE FUNCTION act_is_kept()"
        )


def downgrade() -> None:
    """Remove the tables."""
    Base.metadata.drop_all(op.get_bind())
    if op.get_bind().dialect.name != "sqlite":
        op.execute("DROP FUNCTION act_is_kept()")
