"""A known method as a controller; README.md beside says what it assumes."""
