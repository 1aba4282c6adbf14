"""report: everything about a drive as one page to hand on."""
