"""The shield: replaces a command that would break rules 1 to 3 by the nearest one found that breaks none."""
