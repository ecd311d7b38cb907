"""${message}."""

from __future__ import annotations

import sqlalchemy as sa
from alembic import op

revision = ${repr(up_revision)}
down_revision = ${repr(down_revision)}
branch_labels = None
depends_on = None


def upgrade() -> None:
    """Make the tables of this version from those of the version before."""
    ${upgrades if upgrades else "pass"}


def downgrade() -> None:
    """Make the tables of the version before."""
    ${downgrades if downgrades else "pass"}
