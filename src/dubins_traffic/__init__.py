"""The benchmark "Traffic network of Dubins cars"."""
