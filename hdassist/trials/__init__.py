"""The hidden offset from trials."""
