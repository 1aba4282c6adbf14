"""Measurements of speed, memory and statistical correctness, which are not part of the tests."""

import os

os.environ["HDASSIST_NO_CACHE"] = "1"  # each run computes its samples anew
