"""Random drives with deviations within their tolerances: yield, sensitivities and allocation."""
