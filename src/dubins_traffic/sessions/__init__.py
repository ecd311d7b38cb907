"""Sessions: trials in which other processes drive the ego or e-agents, or move the world."""
