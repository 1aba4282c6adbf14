"""Interactive explorer of a drive in the terminal."""
