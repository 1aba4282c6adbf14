"""Random drives with deviations within their tolerances: yield, sensitivities and allocation."""

TOLERANCE_DRIVES = 500  # default number of random drives of the command tolerance
