"""The cvxpy formulation, the engines that solve it, and the verification of results."""
