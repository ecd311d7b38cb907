"""Many trials, and the place where a trial is put together from its parts."""
