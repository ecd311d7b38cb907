"""Known methods on the ranked suites: a folder each, with what it needs, and stored results."""
