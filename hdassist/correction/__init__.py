"""Correction of the kinematic error by a controller: tables and phasors, and the residual that they leave."""
