"""Surrogate safety measures: what traffic research counts instead of crashes, as metrics of a trial."""
