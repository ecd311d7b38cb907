"""Competitions on the web: accounts, teams, a fair queue in the database, workers that judge, pages and an API.

`serve` runs it all on one machine from a folder; the domain's tables are the queue, so state and queue commit together.
"""
