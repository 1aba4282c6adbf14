"""Features: what the commands compute, and the declaration of their results."""
