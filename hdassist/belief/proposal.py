"""Draws nearer the evidence: after the first draws the field that evidence narrows most is drawn where it agrees.

Importance sampling: each draw is weighted by one over the density that it was drawn with, so that weighted statistics
stay those of the prior and the evidence. The density is nowhere less than LEAST_DENSITY of the prior's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from hdassist.belief.evidence import STIFFNESS_FIGURES, Evidence, log_likelihood
from hdassist.belief.kept import Draw
from hdassist.belief.prior import DrivePrior
from hdassist.model.geometry import Array

PILOT_DRAWS = 64  # draws from the prior, by which the others are proposed
CELLS = 16  # equal parts of the field's probability, in each of which the density is the same
LEAST_DENSITY = 0.15
CHANCE_OF_STEERING = 0.01  # of any field at all to seem narrowed where the evidence narrows none


@dataclass(frozen=True)
class Proposal:
    """A density over the probability of a field, by its place in the prior, in equal cells, 1 on average."""

    field: int
    density: tuple[float, ...]

    def drawn(self, shares: Array) -> tuple[Array, Array]:
        """Draws of the prior moved to this density, shape (draws, at least fields), and the density at each of them."""
        cells = len(self.density)
        below = np.cumsum((0.0, *self.density)) / cells
        moved = shares.copy()
        moved[:, self.field] = np.interp(shares[:, self.field], below, np.linspace(0, 1, cells + 1))
        cell = np.clip(np.searchsorted(below, shares[:, self.field], side="right") - 1, 0, cells - 1)
        return moved, np.array(self.density)[cell]


def proposed_draws(
    prior: DrivePrior, evidence: tuple[Evidence, ...], pilot: Sequence[Draw], first: int, last: int, seed: int
) -> tuple[Array, Array]:
    """Draws first to last - 1 as shares of each field's probability and a spare, and their density, shape (draws,).

    Arguments: pilot, the first draws, PILOT of them where `first` is not below that; seed of the draws.
    """
    shares = prior.shares(last, seed)
    alone = [k for k, each in enumerate(prior.fields) if not each.draws]  # those of a fit are drawn together
    pilot = pilot if alone and first >= PILOT_DRAWS else ()
    found = proposal_of(shares[:PILOT_DRAWS, [*alone, -1]], evidence, pilot)
    if found is None:
        return shares[first:], np.ones(last - first)
    return replace(found, field=alone[found.field]).drawn(shares[first:])


def proposal_of(shares: Array, evidence: tuple[Evidence, ...], pilot: Sequence[Draw]) -> Proposal | None:
    """The proposal by the stiffness of the first draws, also the weeded ones; None where no field alone explains it.

    The field is that by whose share x, and its square, a regression of the log-likelihood leaves least; its density is
    that of weighted draws as far as Legendre's first two polynomials have it. Arguments: shares of these draws, shape
    (draws, at least fields).
    """
    stiff = {k: each.figures for k, each in enumerate(pilot) if each.figures.keys() >= {*STIFFNESS_FIGURES}}
    logs = {k: log_likelihood(evidence, {n: of[n] for n in STIFFNESS_FIGURES}) for k, of in stiff.items()}
    found, y = list(logs), np.array(list(logs.values()))
    if len(y) < PILOT_DRAWS / 2 or np.ptp(y) == 0:
        return None
    x = 2 * shares[found, :-1] - 1
    left = np.array([_left(column, y) for column in x.T])
    field = int(np.argmin(left))
    free = len(y) - 3  # degrees of freedom beside the mean, the share and its square
    if fdtrc(2, free, (1 / left[field] - 1) * free / 2) > CHANCE_OF_STEERING / len(left):
        return None
    weights = np.exp(y) / np.exp(y).sum()
    middles = 2 * (np.arange(CELLS) + 0.5) / CELLS - 1
    mean, spread = weights @ x[:, field], weights @ x[:, field] ** 2
    density = np.maximum(1 + 3 * mean * middles + 5 / 4 * (3 * spread - 1) * (3 * middles**2 - 1), 0)
    return Proposal(field, tuple((LEAST_DENSITY + (1 - LEAST_DENSITY) * density / density.mean()).tolist()))


def _left(x: Array, y: Array) -> float:
    """Share of the variance of y that a parabola in x does not explain."""
    return float(np.var(y - np.polyval(np.polyfit(x, y, 2), x)) / np.var(y))
