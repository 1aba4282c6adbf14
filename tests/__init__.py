"""Tests of hdassist, in the rooms of the package; and `python -m tests.validation`, which makes a page of the docs."""

import os

from hdassist.cli.main import THREADS

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it; numpy is not loaded yet

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy: as the command has it, whose last digits would differ otherwise
