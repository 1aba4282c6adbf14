"""Measurements of speed and memory; not part of the tests."""

import os

os.environ["HDASSIST_NO_CACHE"] = "1"  # each run draws its samples
