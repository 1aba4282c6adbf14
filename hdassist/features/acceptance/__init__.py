"""Verdicts on drives and lots."""
