"""Acceptance tests before they are made: the share of F'_ior that readings at some positions see."""
