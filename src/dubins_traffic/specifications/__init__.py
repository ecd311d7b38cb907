"""The task as formulas, and formulas and specifications as the texts of tools that synthesise and check."""
