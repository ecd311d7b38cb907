"""Road networks: reading, checking, writing, generating them, and finding one's way and place on them."""
