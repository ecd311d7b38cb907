"""Road maps of other programs: their formats, a model of them all, and how one becomes a road network, and back."""
