"""Comparison of a measured error with the predicted one."""
