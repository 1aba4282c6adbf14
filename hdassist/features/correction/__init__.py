"""Correction of the kinematic error by a controller: tables and correction terms, and their residual."""
