"""Pictures, replays and what notebooks show."""
