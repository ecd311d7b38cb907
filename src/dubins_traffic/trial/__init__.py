"""One trial: its phases, its clock, its tick."""
