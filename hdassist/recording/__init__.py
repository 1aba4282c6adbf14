"""One statistical model of a recording: the error as waves on the torus of two angles, with the range that follows."""
