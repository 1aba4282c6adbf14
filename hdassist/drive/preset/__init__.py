"""Presets: YAML text to a validated, immutable `Drive`, and the library of drives."""
