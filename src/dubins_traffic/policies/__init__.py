"""How cars drive: the policy that keeps the rules of the road, and the policy that keeps to lanes."""
