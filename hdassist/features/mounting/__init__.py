"""Choice of the hole for the fixed wheel: positions, their curve, uncertainty, and the decision."""
