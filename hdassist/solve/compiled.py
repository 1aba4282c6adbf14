"""The engines run the formulation's own data: proven to be, bit for bit, those that cvxpy compiles.

cvxpy hands a solver H, local, A, gaps and load as they were stated, whatever their numbers. So it is compiled
and compared once for each version of cvxpy, of the statement, and of the set of free freedoms; that it held is kept in
the user's cache. The tests compile every preset, `hdassist doctor` compiles anew.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from hdassist.errors import UntrustedError
from hdassist.run.cache import cached, keep
from hdassist.solve import formulation as statement
from hdassist.solve.formulation import Formulation

COMPILED_TEMPLATE = "compiled"
_proven: set[tuple[bool, ...]] = set()  # freedoms that were free in the proven programmes, in this process


def require_compiled_as_stated(formulation: Formulation) -> None:
    """Make sure that cvxpy compiles this formulation to the data that the engines run.

    Raises UntrustedError where it compiles to something else.
    """
    supported = tuple(formulation.system.supported.tolist())
    if supported in _proven:
        return
    key = _key(formulation)
    if cached(COMPILED_TEMPLATE, key) is None:
        if wrong := list(template_differences(formulation)):
            raise UntrustedError(
                f"cvxpy compiles the programme to other data than stated: {', '.join(wrong)}",
                "install the versions that hdassist was tested with (hdassist doctor)",
            )
        keep(COMPILED_TEMPLATE, key, b"")
    _proven.add(supported)


def template_differences(formulation: Formulation) -> Iterator[str]:
    """Names of parts that cvxpy compiles to other data than stated, at two torques and gaps."""
    stated, place = formulation.statement, formulation.system.place
    M, m = len(formulation.local), len(formulation.H)
    P = np.zeros((M + m, M + m))
    P[:M, :M], P[M:, M:] = np.diag(formulation.local), formulation.H
    A = np.zeros((len(formulation.A) + m, M + m))
    A[: len(formulation.A), M:] = formulation.A
    A[len(formulation.A) + place, np.arange(M)] = 1
    A[len(formulation.A) + np.arange(m), M + np.arange(m)] = -1
    lower = np.repeat([0.0, -np.inf], [M, m])
    for torque, gap in ((0.0, 0.0), (1e3, 1.0)):
        stated.gaps.value = gaps = gap * np.arange(1.0, M + 1)
        stated.load.value = load = formulation.load(torque)
        data, _, _ = stated.problem.get_problem_data("DAQP")
        expected: dict[str, Any] = {"P": P, "q": np.pad(gaps, (0, m)), "A": A, "b": np.pad(-load, (0, m))}
        expected |= {"lower_bounds": lower, "upper_bounds": None}
        if data["F"].shape[0]:
            yield "further rows"
        for name, value in expected.items():
            found = data[name]
            found = found.toarray() if hasattr(found, "toarray") else found
            if not np.array_equal(found, value):
                yield name


def _key(formulation: Formulation) -> str:
    source = Path(statement.__file__).read_bytes()
    free = np.flatnonzero(~formulation.system.supported).tolist()
    return hashlib.sha256(f"{version('cvxpy')} {free} ".encode() + source).hexdigest()
