"""File formats of road networks."""
