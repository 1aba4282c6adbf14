"""The terminal and files to write: console, plots, tables, answers, options, workers."""
