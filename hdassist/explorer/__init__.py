"""The explorer: a drive turned on the screen."""
