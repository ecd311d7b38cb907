"""Programs for who works on the package; each says at its head what it does."""
