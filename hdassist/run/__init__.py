"""Execution of work of any kind, and storage of its results."""
