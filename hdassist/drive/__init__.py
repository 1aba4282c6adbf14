"""One drive whose inputs are known: its preset, its model, its solution and its error."""
