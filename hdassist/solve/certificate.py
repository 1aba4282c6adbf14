"""The proof of an answer: residuals of system (1), recomputed from D, G, C and the gaps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from hdassist.model.contacts import ROTATION, ContactSystem
from hdassist.model.geometry import Array

TOLERANCE = 1e-8  # of each residual, as a share of its scale
Residual = Annotated[float, Field(strict=True, ge=0, le=TOLERANCE)]  # of a proven answer, in a file


@dataclass(frozen=True)
class Residuals:
    """Residuals of system (1) of states, each as a share of its scale, shape (states, 4).

    Columns: negative force, of the greatest force; negative gap, of the greatest gap without force; complementarity, of
    the product of both; equilibrium, of the sum of the forces' (and moments') sizes.
    """

    shares: Array

    @property
    def worst(self) -> Array:
        """Greatest residual of each state, shape (states,); infinite where one is not a number."""
        worst = self.shares.max(axis=1)
        return np.where(np.isnan(worst), np.inf, worst)


def displacements(system: ContactSystem, forces: Array, free: Array) -> Array:
    """Displacements a [mm, rad], shape (states, 9): those of supports from their forces, the free as given."""
    a = np.empty((len(forces), len(system.C)))
    supported = system.supported
    a[:, supported] = forces @ system.G[:, supported] / system.C[supported]
    a[:, ~supported] = free
    return a


def residuals(system: ContactSystem, delta_p: Array, torque: float, forces: Array, free: Array) -> Residuals:
    """Residuals of answers to system (1).

    Arguments: delta_p, gaps without force [mm], and forces [N], both shape (states, M); torque [N*mm]; free,
    displacements of the freedoms without support [mm, rad], shape (states, free).
    """
    a = displacements(system, forces, free)
    moved = system.at_places(forces) @ system.compliance + a @ system.G[system.first].T
    gaps = delta_p + forces * system.local + moved[:, system.place]
    balance = forces @ system.G - a * system.C
    balance[:, ROTATION] += torque
    force_scale = np.maximum(np.abs(forces).max(axis=1), np.finfo(float).tiny)
    gap_scale = np.maximum(np.abs(delta_p).max(axis=1), np.finfo(float).tiny)
    balance_scale = np.abs(forces) @ np.abs(system.G)
    balance_scale[:, ROTATION] += np.abs(torque)
    rounding = np.finfo(float).eps * np.abs(forces).sum(axis=1)[:, None] * np.abs(system.G).max(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # a freedom without any force on it is in balance: a ball on one axis pushes along the other by rounding alone
        unbalanced = np.where(np.abs(balance) <= rounding, 0.0, np.abs(balance) / balance_scale)
    pulled, closed = (np.maximum(-signed.min(axis=1), 0) for signed in (forces, gaps))
    product = np.abs(gaps * forces).max(axis=1) / (force_scale * gap_scale)
    return Residuals(np.stack([pulled / force_scale, closed / gap_scale, product, unbalanced.max(axis=1)], axis=1))
