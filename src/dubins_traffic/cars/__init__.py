"""Cars: bodies, bounds, motion, contact, sensing."""
