"""Metrics: sinks that turn the frames of a trial into numbers, live or from a record, and the score sheet."""
