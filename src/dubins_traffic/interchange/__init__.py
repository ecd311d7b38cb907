"""Bags and logs of other tools, to and from records."""
