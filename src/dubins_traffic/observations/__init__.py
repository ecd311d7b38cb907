"""Observations: what a driver knows of a frame, as named tuples and as flat vectors in a car's own frame."""
