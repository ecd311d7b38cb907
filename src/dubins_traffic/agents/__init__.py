"""E-agents: what each kind does, as kernels over a batch, and the fleet that drives them all."""
