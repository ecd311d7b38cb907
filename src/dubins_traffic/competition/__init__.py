"""Competitions: phases whose seeds may be secret, submissions of strangers, how they are judged, ranked and shown."""
