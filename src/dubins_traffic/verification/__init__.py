"""Verification of records: trials of this package's simulator are simulated again, those of other worlds checked."""
