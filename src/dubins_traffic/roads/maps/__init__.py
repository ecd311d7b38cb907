"""Road maps of other programs: a model of them all, and how one becomes a road network of ours, and back."""
