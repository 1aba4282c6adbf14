from __future__ import annotations

import gc
import os
import shutil
import tempfile
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import settings

from hdassist.interface.cli import THREADS
from hdassist.run.kept import FOLDER, NO_CACHE

gc.disable()  # until all tests are collected: searching their syntax trees for garbage takes a third of that time
IS_WORKER = "PYTEST_XDIST_WORKER" in os.environ
if not IS_WORKER:  # never the user's own cache; workers share one
    os.environ[FOLDER] = tempfile.mkdtemp(prefix="hdassist-tests-")
os.environ.setdefault(NO_CACHE, "1")  # samples are drawn, but where a test is of those that are kept

from tests.helpers.process import hear_what_is_ignored, keep_answers  # noqa: E402 (its processes get the environment of now)

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hdassist import Drive
    from hdassist.drive.model.geometry import Array
    from hdassist.drive.solve.formulation import Formulation

for name in THREADS:
    os.environ.setdefault(name, "1")  # as the command line has it, before numpy is loaded
os.environ["HDASSIST_STRICT"] = "1"  # a plot or a page that fails is a failure here
settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")
hear_what_is_ignored()

from hdassist.drive.solve import loadcase  # noqa: E402 (numpy is loaded by it, with the threads that are set above)

_solve_through_cvxpy, _solved = loadcase.solve_through_cvxpy, dict[tuple[object, ...], tuple["Array", "Array"]]()


def _solve_once(
    formulation: Formulation,
    delta_p: Array,
    torque: float,
    solver: str,
    limits: Mapping[str, Any] = MappingProxyType({}),
) -> tuple[Array, Array]:
    """Return the solution of a state through cvxpy; the fastest solver solves each state once.

    Commands of the tests solve the same states several times: this is four fifths of the time of `mount` of TINY.
    """
    name = solver.upper()
    if name != loadcase.CROSS_SOLVER:
        return _solve_through_cvxpy(formulation, delta_p, torque, solver, limits)
    settings = {**loadcase.SOLVER_SETTINGS[name], **limits}
    state = formulation.digest, delta_p.tobytes(), torque, repr(settings)
    if state not in _solved:
        _solved[state] = _solve_through_cvxpy(formulation, delta_p, torque, solver, limits)
    return _solved[state]


loadcase.solve_through_cvxpy = _solve_once

ROOT = Path(__file__).parents[1]
POSIX_ONLY = {  # modules and folders, and the part of POSIX that they need
    "explorer/test_terminal.py": "pseudo-terminals",
    "fuzz": "pseudo-terminals, limits of processes, and signals",
    "hostile/test_inputs.py": "limits of processes, named pipes, and devices",
    "run/test_executors.py": "signals; the engines of other packages are not tried on Windows",
    "run/test_stops.py": "signals",
    "terminal/test_full_device.py": "limits of processes",
    "test_pages.py": "a shell for the commands of pages",
    "test_readme.py": "a shell for the commands of the README",
}
collect_ignore = [] if os.name == "posix" else list(POSIX_ONLY)


def pytest_collection_finish() -> None:
    """Keep what all tests share: fits of recordings, and modules and tests, which need no search for garbage.

    That search takes 7 % of the suite's time. The fits are kept here, where all modules are loaded, because the process
    that starts the workers need not load them.
    """
    from tests.helpers.fits import keep_fits

    keep_fits()
    gc.collect()
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)
    gc.enable()


def pytest_sessionfinish() -> None:
    if not IS_WORKER:
        shutil.rmtree(os.environ[FOLDER], ignore_errors=True)


@pytest.fixture(scope="session")
def reference() -> Drive:
    """The frozen reference preset: the paper's drive with the values the reference numbers were made with."""
    from hdassist import load_preset

    return load_preset(str(ROOT / "tests/validation/vzp160_reference.yaml"))


@pytest.fixture(autouse=True)
def own_files() -> None:
    """Forget the files of the test before: the system may give a new file the number of a deleted one."""
    from hdassist.run.files import begin_run

    begin_run()


@pytest.fixture
def short_chains(monkeypatch: pytest.MonkeyPatch) -> None:
    """End the fit of a recording at the fewest effective samples that give a result: where no interval is tested."""
    monkeypatch.setattr("hdassist.recording.chain.ENOUGH_SAMPLES", 40.0)


@pytest.fixture(scope="module")
def of_module(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for the answers that are kept for the tests of one module."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture
def kept(of_module: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Compute an answer once that several commands or tests of a module share: for tests of what is made of it."""
    keep_answers(of_module, monkeypatch)
