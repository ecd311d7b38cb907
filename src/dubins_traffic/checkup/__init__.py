"""The check of a controller as before a competition: scenarios, passes over them, verdicts."""
