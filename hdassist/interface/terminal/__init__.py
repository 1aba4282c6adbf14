"""Terminal and output files: console, plots, tables, results, options and workers."""
