"""Results from a measured recording: F'_ior, orders, coverage and uncertainty."""
