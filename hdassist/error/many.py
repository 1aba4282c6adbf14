"""F'_ior of very many drives that differ in their deviations alone, from a table of the error."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import Executor

import numpy as np

from hdassist.error.table import ErrorTable, turns
from hdassist.model.deviations import displaced, scalars_of
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive

CHUNK = 256  # drives that a task looks at

_Task = tuple[Drive, ErrorTable, dict[str, Array], complex]


def F_ior_of_many(
    drive: Drive,
    table: ErrorTable,
    values: Mapping[str, Array],
    *,
    off_um: complex = 0,
    executor: Executor | None = None,
) -> Array:
    """F'_ior [arcsec], shape (drives,), from a table.

    Arguments: drive, what they have in common; table; values of the other fields by path, shape (drives,); off_um, what
    the fixed wheel lies off its centre, along x + i y; executor, to spread the work over. Raises UntrustedError for
    deviations that the table does not span.
    """
    length = len(next(iter(values.values())))
    parts = [slice(k, k + CHUNK) for k in range(0, length, CHUNK)]
    tasks = [(drive, table, {path: v[part, None] for path, v in values.items()}, off_um) for part in parts]
    return np.concatenate(list((executor.map if executor else map)(_part, tasks)))


def _part(task: _Task) -> Array:
    drive, table, values, off_um = task
    alpha_g, alpha_b = turns(table.turns)
    found = []
    for k in range(0, len(next(iter(values.values()))), 16):  # so that arrays stay in the cache
        here = {path: column[k : k + 16] for path, column in values.items()}
        scalars = scalars_of(
            lambda path, of=here: of[path] if path in of else drive.number(path),  # type: ignore[misc]
            drive.mounting.mark_kind,
            alpha_g,
            alpha_b,
        )
        if off_um:
            scalars = displaced(scalars, off_um * 1e-3, alpha_b if drive.mounting.fixed == "rigid" else alpha_g)
        found.append(table.F_ior(scalars))
    return np.concatenate(found)
