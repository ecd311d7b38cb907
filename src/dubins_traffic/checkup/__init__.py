"""What a competition would say of a controller: scenarios, passes over them, verdicts."""
