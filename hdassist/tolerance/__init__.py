"""Random drives inside their tolerances: yield, sensitivity, allocation."""
