"""Questions that a user asks of a drive, one a file."""
