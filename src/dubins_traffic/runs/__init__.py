"""Putting a run together: what a path holds, which trials come of it, and how they are run one by one."""
