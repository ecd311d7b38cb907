"""Tests of the house: docstrings, names, sizes, circles and duplicates in src."""
