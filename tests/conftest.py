from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from hdassist.cli.main import THREADS
from tests.process import hear_what_is_ignored

if TYPE_CHECKING:
    from hdassist import Drive

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it, before numpy is loaded
os.environ["HDASSIST_STRICT"] = "1"  # a plot or a page that fails is a failure here
settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")
hear_what_is_ignored()

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="session")
def reference() -> Drive:
    """The frozen reference preset: the paper's drive with the values the reference numbers were made with."""
    from hdassist import load_preset

    return load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
