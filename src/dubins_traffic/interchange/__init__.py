"""Converts records to and from bags and logs of other tools."""
