from __future__ import annotations

import gc
import os
import shutil
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from hdassist.cli import THREADS
from hdassist.run.kept import FOLDER, NO_CACHE

IS_WORKER = "PYTEST_XDIST_WORKER" in os.environ
if not IS_WORKER:  # never the user's own cache; workers share one
    os.environ[FOLDER] = tempfile.mkdtemp(prefix="hdassist-tests-")
os.environ.setdefault(NO_CACHE, "1")  # samples are drawn, but where a test is of those that are kept

from tests.process import hear_what_is_ignored  # noqa: E402 (its processes get the environment of now)

if TYPE_CHECKING:
    from hdassist import Drive

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it, before numpy is loaded
os.environ["HDASSIST_STRICT"] = "1"  # a plot or a page that fails is a failure here
settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")
hear_what_is_ignored()

ROOT = Path(__file__).parents[1]


def pytest_collection_finish() -> None:
    """Leave modules and tests, which stay to the end, out of the search for garbage: 7 % of the suite's time."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


def pytest_sessionfinish() -> None:
    if not IS_WORKER:
        shutil.rmtree(os.environ[FOLDER], ignore_errors=True)


@pytest.fixture(scope="session")
def reference() -> Drive:
    """The frozen reference preset: the paper's drive with the values the reference numbers were made with."""
    from hdassist import load_preset

    return load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))
