"""The log of acts can only grow: the database itself refuses to change or remove a row of it."""

from __future__ import annotations

from alembic import op

revision = "0002"
down_revision = "0001"
branch_labels = None
depends_on = None
KEPT = "the log of acts only grows"


def upgrade() -> None:
    """Make the tables of this version from those of the version before."""
    if op.get_bind().dialect.name == "sqlite":
        for what in ("UPDATE", "DELETE"):
            op.execute(
                f"CREATE TRIGGER act_no_{what.lower()} BEFORE {what} ON act "
                f"BEGIN SELECT RAISE(ABORT, '{KEPT}'); END"
            )
    else:
        op.execute(
            "CREATE FUNCTION act_is_kept() RETURNS trigger LANGUAGE plpgsql AS "
            f"$$BEGIN RAISE EXCEPTION '{KEPT}'; END$$"
        )
        op.execute(
            "CREATE TRIGGER act_kept BEFORE UPDATE OR DELETE OR TRUNCATE ON act "
            "FOR EACH STATEMENT EXECUTE FUNCTION act_is_kept()"
        )


def downgrade() -> None:
    """Make the tables of the version before."""
    if op.get_bind().dialect.name == "sqlite":
        for what in ("update", "delete"):
            op.execute(f"DROP TRIGGER act_no_{what}")
    else:
        op.execute("DROP TRIGGER act_kept ON act")
        op.execute("DROP FUNCTION act_is_kept()")
