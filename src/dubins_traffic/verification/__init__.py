"""Records held against what must have happened: simulated again where the world is ours, checked where it is not."""
