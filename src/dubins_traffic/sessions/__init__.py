"""Sessions: trials whose ego, e-agents or world are other processes."""
