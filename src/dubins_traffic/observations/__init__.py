"""What a driver is told: observations from the state of a trial."""
