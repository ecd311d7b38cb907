"""Runs migrations on the connection that `Database.migrate` gives, or on an address given with ``-x url=``."""

from __future__ import annotations

from alembic import context
from sqlalchemy import Connection, create_engine

from dubins_traffic.service.database_tables import Base


def run(connection: Connection) -> None:
    """Run what is asked for on a connection."""
    context.configure(connection=connection, target_metadata=Base.metadata, render_as_batch=True)
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    run(given)
else:
    with create_engine(context.get_x_argument(as_dictionary=True)["url"]).begin() as opened:
        run(opened)
