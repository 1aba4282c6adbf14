"""The kinematic error: the full cycle, the search for its extremes, and its causes."""
