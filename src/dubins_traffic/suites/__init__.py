"""Suites: frozen, named sets of problems with seeds; their results as files that others can compare."""
