"""The physics of a strain wave drive: geometry, rings, contact system, deviations, kinematics."""
