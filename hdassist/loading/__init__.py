"""Drives from the text of presets, checked against the model's geometry, and values put back into such text."""
