"""Least squares of curves at the angles of a trace: orders, a level of each sweep and a drift, factored once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hdassist.errors import UntrustedError
from hdassist.measuring.bins import Cells

CHUNK = 8192  # rows of the design that stand in memory at once
WORST = 1e8  # condition of the normal equations
CELLS_PER_COLUMN = 1.5

Array = NDArray[np.float64]


def waves(turns: Array, orders: Array) -> Array:
    """Cosines, then sines, of the orders at angles [turns], shape (angles, 2 lines)."""
    phase = (2 * np.pi) * turns[:, None] * orders
    return np.concatenate([np.cos(phase), np.sin(phase)], axis=1)


class Design:
    """Normal equations of orders, levels and drift on the cells of a trace.

    columns: unknowns, cosines and sines of the orders first; reach: travel [turns] at the end of the drift; root: times
    its transpose the inverse of the normal equations, shape (columns, columns); condition: of these.
    Raises UntrustedError: too few cells, or angles at which the orders cannot be told apart.
    """

    def __init__(self, cells: Cells, orders: Array, degree: int = 0) -> None:
        self._cells, self._orders, self._degree = cells, orders, degree
        self._sweeps = int(cells.sweep[-1]) + 1
        self.reach = max(float(cells.travel.max()), 1e-12)
        self.columns = columns = 2 * len(orders) + self._sweeps + degree
        if len(cells) < CELLS_PER_COLUMN * columns:
            message = f"{len(cells)} steps of the angle are too few for {columns} unknowns"
            raise UntrustedError(message, "record more densely, or declare fewer orders: --orders 1,2,4")
        self._parts = [slice(k, min(k + CHUNK, len(cells))) for k in range(0, len(cells), CHUNK)]
        gram = np.zeros((columns, columns))
        self._moment = np.zeros(columns)
        for rows in self._parts:
            matrix = self._rows(rows)
            weighted = matrix * cells.weight[rows, None]
            gram += weighted.T @ matrix
            self._moment += weighted.T @ cells.error[rows]
        scale = 1 / np.sqrt(np.diag(gram))
        values, vectors = np.linalg.eigh(gram * scale * scale[:, None])
        self.condition = float(values[-1] / values[0]) if values[0] > 0 else float("inf")
        if self.condition > WORST:
            message = "the angles that were recorded do not tell the declared orders apart"
            raise UntrustedError(
                message, "record one cam turn or more, evenly; or declare fewer orders: --orders 1,2,4"
            )
        # the symmetric root: vectors of values that are nearly alike are a matter of rounding, and draws with them
        self.root: Array = scale[:, None] * ((vectors / np.sqrt(values)) @ vectors.T)

    def _rows(self, rows: slice) -> Array:
        cells = self._cells
        levels = np.eye(self._sweeps)[cells.sweep[rows]]
        drift = (cells.travel[rows, None] / self.reach) ** np.arange(1, self._degree + 1)
        return np.concatenate([waves(cells.turns[rows], self._orders), levels, drift], axis=1)

    def solution(self) -> Array:
        """Unknowns that fit the error of the cells best, shape (columns,)."""
        return np.asarray(self.root @ (self.root.T @ self._moment))

    def residual(self, solution: Array) -> Array:
        """What a solution leaves of the cells' error, shape (cells,)."""
        fitted = np.concatenate([self._rows(rows) @ solution for rows in self._parts])
        return np.asarray(self._cells.error - fitted)

    def project(self, curves: Callable[[slice], Array]) -> Array:
        """Unknowns that fit other curves best, shape (columns, curves), from their values at a slice of the cells."""
        moments = [(self._rows(rows) * self._cells.weight[rows, None]).T @ curves(rows) for rows in self._parts]
        return np.asarray(self.root @ (self.root.T @ sum(moments)))
