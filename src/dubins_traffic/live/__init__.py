"""Trials in a page of the browser while they run: who may open it, what it is sent, and a person who drives there."""
