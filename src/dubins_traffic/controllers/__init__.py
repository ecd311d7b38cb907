"""Ego controllers: one file each, and the registry that finds them, or a user's own, by name."""
