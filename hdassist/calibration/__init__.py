"""Stiffnesses and clearances from measurements."""
