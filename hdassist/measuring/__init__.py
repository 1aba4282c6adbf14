"""What a measured trace says: F'_ior, orders, coverage, uncertainty."""
