"""The shield: the command nearest to the one asked for with which the ego breaks none of rules 1 to 3."""
