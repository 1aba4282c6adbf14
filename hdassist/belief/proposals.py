"""Draws nearer the evidence: of stiffness, by the field it narrows most, and of F'_ior, by tables of the error.

Importance sampling: each draw is weighted by one over the density that it was drawn with, so that weighted statistics
stay those of the prior and the evidence. The density is nowhere less than a share of the prior's.

A table (error/error_map.py) costs as much as some searches, a drive read off it hardly any. Turning the wheel forward
is turning back all that stands: a draw whose offset points one step further has, one position further, the F'_ior of
the draw before it. So each draw is read in all directions of what stands, and all positions of it cost one F'_ior each.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from hdassist.belief.evidence import (
    STIFFNESS_FIGURES,
    Evidence,
    log_likelihood,
    log_likelihood_of_errors,
    values_of_errors,
)
from hdassist.belief.prior import DrivePrior, FieldPrior
from hdassist.belief.statistics import log_error, sobol_points
from hdassist.error.error_map import TABLE_SECTIONS, Batch, ErrorMap, Mesh, Reach, error_table
from hdassist.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.model.deviations import carried, standing_offset
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive, deviation_sizes
from hdassist.solve.answers import EMPTY, Certificate

_Pilot = Sequence[Mapping[str, float]]  # figures of the first draws, by name
PILOT_DRAWS = 64  # draws from the prior, by which the others are proposed
_CELLS = 16  # equal parts of the field's probability, in each of which the density is the same
LEAST_DENSITY = 0.15
_CHANCE_OF_STEERING = 0.01  # of any field at all to seem narrowed where the evidence narrows none


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
    prior: DrivePrior, evidence: tuple[Evidence, ...], pilot: _Pilot, first: int, last: int, seed: int
) -> tuple[Array, Array]:
    """Draws first to last - 1 as shares of each field's probability and a spare, and their density, shape (draws,).

    Arguments: pilot, figures of the first draws, PILOT_DRAWS of them where `first` is not below that; seed.
    """
    shares = prior.shares(last, seed)
    alone = [k for k, each in enumerate(prior.fields) if not each.draws]  # those of a fit are drawn together
    pilot = pilot if alone and first >= PILOT_DRAWS else ()
    found = proposal_of(shares[:PILOT_DRAWS, [*alone, -1]], evidence, pilot)
    if found is None:
        return shares[first:], np.ones(last - first)
    return replace(found, field=alone[found.field]).drawn(shares[first:])


def proposal_of(shares: Array, evidence: tuple[Evidence, ...], pilot: _Pilot) -> Proposal | None:
    """The proposal by the stiffness of the first draws, also the weeded ones; None where no field alone explains it.

    The field is that by whose share x, and its square, a regression of the log-likelihood leaves least; its density is
    that of weighted draws as far as Legendre's first two polynomials have it. Arguments: shares of these draws, shape
    (draws, at least fields).
    """
    logs = stiffness_log_likelihoods(evidence, pilot)
    found, y = list(logs), np.array(list(logs.values()))
    if len(y) < PILOT_DRAWS / 2 or np.ptp(y) == 0:
        return None
    x = 2 * shares[found, :-1] - 1
    left = np.array([_left(column, y) for column in x.T])
    field = int(np.argmin(left))
    free = len(y) - 3  # degrees of freedom beside the mean, the share and its square
    if fdtrc(2, free, (1 / left[field] - 1) * free / 2) > _CHANCE_OF_STEERING / len(left):
        return None
    weights = np.exp(y) / np.exp(y).sum()
    middles = 2 * (np.arange(_CELLS) + 0.5) / _CELLS - 1
    mean, spread = weights @ x[:, field], weights @ x[:, field] ** 2
    density = np.maximum(1 + 3 * mean * middles + 5 / 4 * (3 * spread - 1) * (3 * middles**2 - 1), 0)
    return Proposal(field, tuple((LEAST_DENSITY + (1 - LEAST_DENSITY) * density / density.mean()).tolist()))


def stiffness_log_likelihoods(evidence: tuple[Evidence, ...], pilot: _Pilot) -> dict[int, float]:
    """Log likelihood of the stiffness of first draws, by their place; without those that have none."""
    stiff = {k: each for k, each in enumerate(pilot) if each.keys() >= {*STIFFNESS_FIGURES}}
    return {k: log_likelihood(evidence, {n: of[n] for n in STIFFNESS_FIGURES}) for k, of in stiff.items()}


def _left(x: Array, y: Array) -> float:
    """Share of the variance of y that a parabola in x does not explain."""
    return float(np.var(y - np.polyval(np.polyfit(x, y, 2), x)) / np.var(y))


_FINEST, _COARSEST = 36, 8  # directions that a draw is read in, at most and at least
_KNOWN_DIRECTION = 8  # times as many draws where they count in one direction alone
_OVALITY = "harmonics.xi_s2"  # direction of what the seat does to the rigid wheel; stands still where that is fixed
_SEARCHED_DRAWS = 20  # draws of a drive that are searched, of which one is chosen
_READ_ERROR = 0.1  # relative, of F'_ior read off a table, in the likelihood by which a draw is proposed
_LEAST_PROPOSED = 0.1  # density of the proposal of a draw over the prior's, at least


@dataclass(frozen=True)
class TableEffort:
    """Draws of the deviations, the mesh of the table, and how many drives are searched to see what it misses.

    The usual mesh misses F'_ior of vzp160 by 3 %, beside the mean.
    """

    deviations: int = 64
    mesh: Mesh = field(default_factory=partial(Mesh, (9, 5, 7, 7), 16))
    compared: int = 1


@dataclass(frozen=True, eq=False)
class TabledErrors:
    """F'_ior of draws of the deviations of a drive, with what stands turned in equal steps.

    F_ior_arcsec, shape (torques, draws, directions); log_missed, logarithm of the exact F'_ior of some of them over
    that, shape (torques, compared); values of the deviations by path, shape (draws, directions); shares of the
    probability of those that are open, shape (draws, fields).
    """

    F_ior_arcsec: Array
    log_missed: Array
    values: Mapping[str, Array]
    shares: Array
    certificate: Certificate


def open_deviations(prior: DrivePrior) -> tuple[FieldPrior, ...]:
    """Fields of a prior that a table spans."""
    return tuple(each for each in prior.fields if each.path.startswith(TABLE_SECTIONS))


def _directions_of(drive: Drive) -> int:
    """Number of directions that draws are read in: the seat's holes, or some of each."""
    holes = drive.mounting.holes
    return holes * -(-_COARSEST // holes) if 0 < holes <= _FINEST else _FINEST


def any_direction(prior: DrivePrior) -> bool:
    """Whether every direction of what stands is equally likely; else draws count in the one that they have.

    A standing ovality whose direction is known does not turn with the offset.
    """
    drive, known = prior.drive, {each.path: each for each in prior.fields}
    turn, ovality = (known.get(path) for path in (standing_offset(drive)[1], _OVALITY))
    oval = drive.mounting.fixed == "rigid" and drive.value("harmonics.a_s2") != 0
    if turn is None or not turn.is_any_direction or turn.high != 360:
        return False
    return not oval or (ovality is not None and ovality.is_any_direction)


def tabled_errors(
    maps: Sequence[ErrorMap], prior: DrivePrior, effort: TableEffort, seed: list[int], other: DrivePrior | None = None
) -> TabledErrors:
    """Draws of the deviations that a prior leaves open, and their F'_ior with all else of a drive.

    Arguments: maps of the drive, one a torque; seed of these draws, its last number that of the drive among others;
    other, a prior of which fewer draws stand behind these, each to be counted in the direction that it has.
    Raises UntrustedError where an answer cannot be trusted.
    """
    drive = maps[0].drive
    shares, columns = _draws(prior, effort.deviations, seed)
    if other:
        _, more = _draws(other, effort.deviations // _KNOWN_DIRECTION, seed, tuple(columns))
        columns = {path: np.concatenate([of, more[path]]) for path, of in columns.items()}
    shape, number = columns[standing_offset(drive)[1]].shape, seed[-1]
    sizes = {path: float(column.max()) for path, column in columns.items() if path in deviation_sizes()}
    reach, rows = Reach.of(drive.with_values(sizes)), np.arange(effort.compared)
    some = {path: column[rows, (number + 5 * rows) % shape[1]] for path, column in columns.items()}
    exact = [many_extremes(each, Batch(drive, some), DRAWN_GRIDS) for each in maps if len(rows)]
    tables = [error_table(each, reach, effort.mesh) for each in maps]
    read = [log_error(table.F_ior(some)) for table in tables if len(rows)]
    log_missed = [log_error(known.F_ior_arcsec) - each for known, each in zip(exact, read, strict=True)]
    flat = {path: column.ravel() for path, column in columns.items()}
    F_ior = np.array([table.F_ior(flat).reshape(shape) for table in tables])
    proof = sum((each.certificate for each in exact), sum((each.certificate for each in tables), EMPTY))
    return TabledErrors(F_ior, np.array(log_missed), columns, shares, proof)


def turned_errors(F_ior: Array, rotations_deg: Sequence[float], places: NDArray[np.int64]) -> Array:
    """F'_ior [arcsec] with the wheel turned, shape (places, rotations): that of directions less by as much.

    Arguments: F_ior [arcsec] as the wheel stands, shape (draws, directions); flat places among these.
    """
    count = F_ior.shape[1]
    draw, direction = np.divmod(places, count)
    whole, part = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
    turned = direction[:, None] - whole.astype(int)
    here, beside = (F_ior[draw[:, None], (turned - j) % count] for j in (0, 1))
    return np.asarray((1 - part) * here + part * beside)


@dataclass(frozen=True)
class DeviationProposal:
    """Draws of the deviations near F'_ior as measured: which errors, and how many draws each is chosen from.

    Importance sampling: a draw is chosen by its likelihood with F'_ior of a table, and weighted by one over the density
    that it was chosen with, so that weighted statistics stay those of the prior and the evidence. So many draws share
    all else of a drive, whose table costs more than they.
    """

    prior: DrivePrior
    errors: tuple[Evidence, ...]
    seed: int
    effort: TableEffort = field(default_factory=partial(TableEffort, 64, Mesh((9, 5, 5, 5), 12), 0))
    draws: int = 4

    def drawn(self, maps: Sequence[ErrorMap], number: int) -> tuple[list[tuple[dict[str, float], float]], Certificate]:
        """Draws: shares of the probability of the open deviations, and density over the prior's; the proof of all.

        A draw that was chosen before has an infinite density, and that one less. Arguments: maps of a drive with all
        else, those at the torques of the errors among them; its number. Raises UntrustedError where an answer cannot be
        trusted.
        """
        drive, fields = maps[0].drive, open_deviations(self.prior)
        maps = [each for each in maps if any(error.M_g == each.M_g for error in self.errors)]
        torques = [each.M_g for each in maps]
        found = tabled_errors(maps, self.prior, self.effort, [self.seed, number])
        every = np.arange(found.F_ior_arcsec[0].size).reshape(len(found.shares), -1)
        places = every.ravel() if any_direction(self.prior) else every[:, 0]
        tabled = [
            turned_errors(found.F_ior_arcsec[torques.index(each.M_g)], [each.rotation_deg], places)
            for each in self.errors
        ]
        log = log_likelihood_of_errors(np.hstack(tabled), *values_of_errors(self.errors), _READ_ERROR)
        likelihood = np.exp(log - log.max())
        density = _LEAST_PROPOSED + (1 - _LEAST_PROPOSED) * likelihood / likelihood.mean()
        rng = np.random.default_rng([self.seed, number])
        some = rng.choice(len(places), _SEARCHED_DRAWS, p=density / density.sum())
        columns = {path: of.ravel()[places[some]] for path, of in found.values.items()}
        extremes, paths = [], carried(drive)
        for each in self.errors:
            turned = {p: columns.get(p, drive.number(p)) + np.full(len(some), each.rotation_deg) for p in paths}
            batch = Batch(drive, columns | turned)
            extremes.append(many_extremes(maps[torques.index(each.M_g)], batch, DRAWN_GRIDS))
        searched = np.stack([each.F_ior_arcsec for each in extremes], axis=1)
        log = log_likelihood_of_errors(searched, *values_of_errors(self.errors))
        agreeing = np.exp(log - log.max())
        ratio, chosen = agreeing / density[some], list[tuple[dict[str, float], float]]()
        even = (rng.random() + np.arange(self.draws)) / self.draws
        ones = np.minimum(np.searchsorted(np.cumsum(ratio / ratio.sum()), even), _SEARCHED_DRAWS - 1)
        for k, (one, place) in enumerate(zip(ones, picked := places[some[ones]], strict=True)):
            draw, direction = np.divmod(place, every.shape[1])
            shares = dict(zip((each.path for each in fields), found.shares[draw].tolist(), strict=True))
            for f in fields:
                if any_direction(self.prior) and f.path in _standing_directions(drive):
                    shares[f.path] = found.values[f.path][draw, direction] / f.high % 1
            alike = np.inf if place in picked[:k] else 1 / np.count_nonzero(picked == place)
            chosen.append((shares, float(agreeing[one] / ratio.mean() * alike)))
        return chosen, sum((each.certificate for each in extremes), found.certificate)


def _standing_directions(drive: Drive) -> tuple[str, ...]:
    """Directions of deviations that stand with the fixed wheel, by path."""
    turn = standing_offset(drive)[1]
    return (turn,) if drive.mounting.fixed == "flexspline" else (turn, _OVALITY)


def _draws(
    prior: DrivePrior, count: int, seed: list[int], paths: tuple[str, ...] = ()
) -> tuple[Array, dict[str, Array]]:
    """Draws of the open deviations: shares of each field's probability, and values with what stands turned, by path.

    paths: of further fields, known by this prior. Where all are known it has one draw.
    """
    drive, directions, every = prior.drive, _directions_of(prior.drive), any_direction(prior)
    fields, stand = open_deviations(prior), _standing_directions(drive)
    count = (count if every else count * _KNOWN_DIRECTION) if fields else 1
    shares = sobol_points(2 ** int(np.ceil(np.log2(count))), len(fields), seed)
    drawn = {path: np.full(len(shares), drive.number(path)) for path in (*standing_offset(drive), *stand, *paths)}
    drawn |= {each.path: each.value(shares[:, k]) for k, each in enumerate(fields)}
    if every:  # of each direction its own part of the turn
        drawn[stand[0]] = drawn[stand[0]] / directions
    turned = 360 / directions * np.arange(directions)
    return shares, {
        path: np.add.outer(of, turned) % 360 if path in stand else np.repeat(of[:, None], directions, axis=1)
        for path, of in drawn.items()
    }
