"""A measured trace over the predicted one."""
