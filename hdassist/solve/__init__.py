"""The cvxpy formulation, the engines that run it, and the proof of an answer."""
