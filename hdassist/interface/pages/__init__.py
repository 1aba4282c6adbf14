"""Results of the commands as reports, and their output as terminal pages, JSON, CSV, HTML and Markdown."""
