"""Design checks: F'_ior, trace, self error, stiffness of a drive."""
