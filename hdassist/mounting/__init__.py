"""Where to mount the fixed wheel: positions, their curve, uncertainty, the card."""
