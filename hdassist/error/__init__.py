"""The kinematic error: the full cycle, the search for its extremes, what makes it."""
