"""The policy that keeps the rules of the road, for e-agents and the ego alike (compiled)."""
