from __future__ import annotations

import os
from pathlib import Path

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy: as the command has it, whose last digits would differ otherwise

import pytest
from hypothesis import settings

from hdassist import Drive, load_preset

settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def reference() -> Drive:
    """The frozen reference preset: the paper's drive with the values the reference numbers were made with."""
    return load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
