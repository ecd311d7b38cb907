"""Routing: the graph of lanes, rounds through the goals, and their times in free flow."""
