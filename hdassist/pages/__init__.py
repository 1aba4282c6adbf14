"""What an answer looks like: on a terminal, as JSON, CSV, HTML and Markdown."""
