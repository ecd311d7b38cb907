"""Temporal logic: formulas, their syntaxes, monitors, robustness and exports."""
