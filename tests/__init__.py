"""Tests of hdassist, in the rooms of the package; and `python -m tests.validation`, which makes a page of the docs."""

import os

from hdassist.interface.cli import THREADS

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it; numpy is not loaded yet
