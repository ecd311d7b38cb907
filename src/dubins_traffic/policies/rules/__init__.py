"""The policy that keeps the rules of the road (docs/rules.md), for e-agents and the ego alike (compiled)."""
