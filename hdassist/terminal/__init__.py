"""What knows a terminal or a file to write: console, plots, tables, answers, options, workers."""
