"""Migrations of the tables, one file a version; `Database.migrate` runs them."""
