"""Commands of the command line, with their options, their computations and the output of their results."""
