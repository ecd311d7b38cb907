"""Campaigns: many trials by one file, run in chunks, kept in a folder, compared in a report."""
