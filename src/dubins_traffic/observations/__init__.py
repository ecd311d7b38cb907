"""What a driver is told: observations from the state of a trial, as values, and as flat vectors in a car's frame."""
