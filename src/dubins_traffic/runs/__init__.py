"""Runs: what a path holds, which trials follow from it, and how they are run one by one or in processes."""
