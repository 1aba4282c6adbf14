"""Random drives inside their tolerances: yield, sensitivity, allocation, sweeps, on one machine or many."""
