"""The forms of an answer: on a terminal, as JSON, CSV, HTML and Markdown."""
