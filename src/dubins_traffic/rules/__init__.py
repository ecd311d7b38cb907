"""The rules of the road: propositions, queues, the referee, and the task as formulas (docs/rules.md)."""
