"""A statistical model of a recording: the error as waves on the torus of two angles, and the resulting range."""
