"""What comes of a phase that does not show all is encrypted; a trial may have a replay that its team alone sees."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables of this version from those of the version before."""
    for table in ("trial", "standing"):
        op.add_column(table, sa.Column("hidden", sa.LargeBinary(), nullable=True))
    op.add_column("trial", sa.Column("own_replay", sa.String(64), nullable=True))


def downgrade() -> None:
    """Make the tables of the version before."""
    op.drop_column("trial", "own_replay")
    for table in ("trial", "standing"):
        op.drop_column(table, "hidden")
