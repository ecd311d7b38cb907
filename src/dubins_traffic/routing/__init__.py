"""Finding one's way: the graph of lanes, rounds through the goals, and how long they take on an empty road."""
