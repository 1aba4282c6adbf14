"""Answers from a measured trace: F'_ior, orders, coverage, uncertainty."""
