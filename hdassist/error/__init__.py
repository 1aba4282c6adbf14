"""The kinematic error: the full cycle, the search for its extremes, its causes."""
