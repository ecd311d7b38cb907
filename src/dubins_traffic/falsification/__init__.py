"""The worst case within the assumption: trials in which an ego breaks the rules, searched, shrunk, and how often."""
