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
    tested_positions,
    values_of_errors,
)
from hdassist.belief.prior import DrivePrior, FieldPrior
from hdassist.belief.statistics import log_error, sobol_points
from hdassist.error.error_map import TABLE_SECTIONS, Batch, ErrorMap, ErrorTable, Mesh, Reach, error_table
from hdassist.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.error.readings import position_states
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
        """Return draws of the prior moved to this density, and the density at each of them.

        shares: of the prior's draws, shape (draws, at least fields); the moved ones have the same shape.
        """
        cells = len(self.density)
        # inverse of the distribution function: equal steps in, steps by density out
        edges = np.cumsum((0.0, *self.density)) / cells  # probability of the density below each edge of a cell
        moved = shares.copy()
        moved[:, self.field] = np.interp(shares[:, self.field], edges, np.linspace(0, 1, cells + 1))
        # the density at a draw divides its weight, so the prior is unchanged
        cell = np.clip(np.searchsorted(edges, shares[:, self.field], side="right") - 1, 0, cells - 1)
        return moved, np.array(self.density)[cell]


def proposed_draws(
    prior: DrivePrior,
    evidence: tuple[Evidence, ...],
    pilot: _Pilot,
    first: int,
    last: int,
    seed: int,
) -> tuple[Array, Array]:
    """Return draws as shares of each field's probability and a spare, and their density, shape (draws,).

    prior: of the drive.
    evidence: on the drive.
    pilot: figures of the first draws, PILOT_DRAWS of them if `first` is not below that.
    first, last: numbers of the draws, from the first to before the last.
    seed: of the draws.
    """
    shares = prior.shares(last, seed)
    independent = [k for k, field_prior in enumerate(prior.fields) if not field_prior.draws]  # a fit draws its together
    # the pilot itself is drawn from the prior
    if not independent or first < PILOT_DRAWS:
        pilot = ()
    proposal = proposal_of(shares[:PILOT_DRAWS, [*independent, -1]], evidence, pilot)
    if proposal is None:
        return shares[first:], np.ones(last - first)
    return replace(proposal, field=independent[proposal.field]).drawn(shares[first:])


def proposal_of(
    shares: Array,
    evidence: tuple[Evidence, ...],
    pilot: _Pilot,
) -> Proposal | None:
    """Return the proposal by the stiffness of the first draws; None if no field alone explains it.

    The field is that by whose share x, and its square, a regression of the log-likelihood leaves least; its density is
    that of weighted draws as far as Legendre's first two polynomials have it.

    shares: of the first draws, those that did not go on included, shape (draws, at least fields).
    evidence: on the drive.
    pilot: figures of these draws.
    """
    # stiffness is known from the contact system alone, before any error is solved
    log_of_draw = stiffness_log_likelihoods(evidence, pilot)
    draws = list(log_of_draw)
    y = np.array(list(log_of_draw.values()))
    # too few drives among the pilot, or evidence that all of them meet alike
    if len(y) < PILOT_DRAWS / 2 or np.ptp(y) == 0:
        return None
    x = 2 * shares[draws, :-1] - 1
    # which field alone explains most of the log likelihood
    unexplained = np.array([_unexplained_share(column, y) for column in x.T])
    field = int(np.argmin(unexplained))
    free = len(y) - 3  # degrees of freedom beside the mean, the share and its square
    # F test of the parabola with 2 and `free` degrees of freedom
    F_ratio = (1 / unexplained[field] - 1) * free / 2
    # divided by the number of fields, as the best of many is looked at
    if fdtrc(2, free, F_ratio) > _CHANCE_OF_STEERING / len(unexplained):
        return None
    # moments of the posterior of this field, over the pilot
    weights = np.exp(y) / np.exp(y).sum()
    mean = weights @ x[:, field]
    mean_square = weights @ x[:, field] ** 2
    return Proposal(field, _legendre_density(mean, mean_square))


def _legendre_density(mean: float, mean_square: float) -> tuple[float, ...]:
    """Return a density over -1 to 1 in equal cells, by the moments of x: 1 on average, at least LEAST_DENSITY.

    p(x) = 1 + 3 E[P_1] P_1(x) + 5 E[P_2] P_2(x), with P_1 = x and P_2 = (3 x^2 - 1)/2.
    """
    middles = 2 * (np.arange(_CELLS) + 0.5) / _CELLS - 1
    # Legendre polynomials 1, x and (3 x^2 - 1)/2 with the given moments
    series = 1 + 3 * mean * middles + 5 / 4 * (3 * mean_square - 1) * (3 * middles**2 - 1)
    density = np.maximum(series, 0)
    # a floor bounds the weights: no sample counts more than 1/LEAST_DENSITY
    return tuple((LEAST_DENSITY + (1 - LEAST_DENSITY) * density / density.mean()).tolist())


def stiffness_log_likelihoods(evidence: tuple[Evidence, ...], pilot: _Pilot) -> dict[int, float]:
    """Return the log likelihood of the stiffness of first draws, by their place; without those that have none."""
    log_of_draw = {}
    for place, figures in enumerate(pilot):
        # a draw that made no drive has none
        if figures.keys() >= {*STIFFNESS_FIGURES}:
            stiffness = {name: figures[name] for name in STIFFNESS_FIGURES}
            log_of_draw[place] = log_likelihood(evidence, stiffness)
    return log_of_draw


def _unexplained_share(x: Array, y: Array) -> float:
    """Return the share of the variance of y that a parabola in x does not explain."""
    return float(np.var(y - np.polyval(np.polyfit(x, y, 2), x)) / np.var(y))


_FINEST = 36  # directions that a draw is read in, at most
_COARSEST = 8  # and at least
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

    F_ior_arcsec, shape (torques, draws, directions); tested_arcsec, what a test of the accuracy reads at the first
    torque, shape (draws, directions); log_missed, logarithm of the exact F'_ior of some of them over
    that, shape (torques, compared); values of the deviations by path, shape (draws, directions); shares of the
    probability of those that are open, shape (draws, fields).
    """

    F_ior_arcsec: Array
    tested_arcsec: Array
    log_missed: Array
    values: Mapping[str, Array]
    shares: Array
    certificate: Certificate


def open_deviations(prior: DrivePrior) -> tuple[FieldPrior, ...]:
    """Return the fields of a prior that a table spans."""
    return tuple(field_prior for field_prior in prior.fields if field_prior.path.startswith(TABLE_SECTIONS))


def _directions_of(drive: Drive) -> int:
    """Return the number of directions that draws are read in: the seat's holes, or some in each of them."""
    holes = drive.mounting.holes
    # whole directions for each hole, so that holes are read without interpolation
    return holes * -(-_COARSEST // holes) if 0 < holes <= _FINEST else _FINEST


def any_direction(prior: DrivePrior) -> bool:
    """Return whether every direction of what stands is equally likely; else draws count in the one that they have.

    A standing ovality whose direction is known does not turn with the offset.
    """
    drive = prior.drive
    prior_of_path = {field_prior.path: field_prior for field_prior in prior.fields}
    # if nothing fixes what stands, one drive serves in every direction
    turn = prior_of_path.get(standing_offset(drive)[1])
    ovality = prior_of_path.get(_OVALITY)
    is_oval = drive.mounting.fixed == "rigid" and drive.value("harmonics.a_s2") != 0
    if turn is None or not turn.is_any_direction or turn.high != 360:
        return False
    return not is_oval or (ovality is not None and ovality.is_any_direction)


def tabled_errors(
    maps: Sequence[ErrorMap],
    prior: DrivePrior,
    effort: TableEffort,
    seed: list[int],
    other: DrivePrior | None = None,
) -> TabledErrors:
    """Return draws of the deviations that a prior leaves open, and their F'_ior with all else of a drive.

    maps: of the drive, one a torque.
    prior: of the deviations.
    effort: of the table.
    seed: of these draws; its last number is that of the drive among others.
    other: a prior of which fewer draws stand behind these, each to be counted in the direction that it has.
    Raises UntrustedError if a state cannot be trusted.
    """
    shares, columns = _draws(prior, effort.deviations, seed)
    # draws in one direction only, of the same sizes
    if other:
        _, directed = _draws(other, effort.deviations // _KNOWN_DIRECTION, seed, tuple(columns))
        columns = {path: np.concatenate([values, directed[path]]) for path, values in columns.items()}
    tables = _tables(maps, columns, effort.mesh)
    log_missed = np.zeros(0)
    proof = sum((table.certificate for table in tables), EMPTY)
    if effort.compared:
        compared = _compared_columns(columns, effort.compared, seed[-1])
        log_missed, of_compared = _log_missed(maps, tables, compared)
        proof += of_compared
    shape = columns[standing_offset(prior.drive)[1]].shape
    flat = {path: values.ravel() for path, values in columns.items()}
    F_ior = [table.F_ior(flat) for table in tables]
    return TabledErrors(
        F_ior_arcsec=np.reshape(F_ior, (-1, *shape)),
        tested_arcsec=_tested(maps[0], tables[0], flat, F_ior[0], seed).reshape(shape),
        log_missed=log_missed,
        values=columns,
        shares=shares,
        certificate=proof,
    )


def _tested(
    error_map: ErrorMap, table: ErrorTable, columns: Mapping[str, Array], F_ior: Array, seed: Sequence[int]
) -> Array:
    """Return what a test of the accuracy reads [arcsec], shape (draws,).

    columns: values of the deviations by path, shape (draws,) each.
    F_ior: the whole of F'_ior [arcsec], shape (draws,).
    seed: of the first positions.
    """
    positions = tested_positions(error_map.drive.catalogue.accuracy_test)
    if not positions:
        return F_ior
    starts = np.random.default_rng([*seed, positions]).random(len(F_ior))
    return table.ranges(columns, position_states(error_map, positions, starts))


def _tables(maps: Sequence[ErrorMap], columns: Mapping[str, Array], mesh: Mesh) -> list[ErrorTable]:
    """Return tables of the error, one a torque, that reach as far as the largest deviations of some draws."""
    # the table reaches as far as the largest drawn size, in any direction
    largest = {path: float(values.max()) for path, values in columns.items() if path in deviation_sizes()}
    reach = Reach.of(maps[0].drive.with_values(largest))
    return [error_table(error_map, reach, mesh) for error_map in maps]


def _compared_columns(
    columns: Mapping[str, Array],
    count: int,
    number: int,
) -> dict[str, Array]:
    """Return the values of the first draws by path, shape (count,), each in another direction.

    columns: values by path, shape (draws, directions).
    number: that of the drive, by which the direction of its first draw is chosen.
    """
    rows = np.arange(count)
    # steps of five directions spread the drives over the seat
    return {path: values[rows, (number + 5 * rows) % values.shape[1]] for path, values in columns.items()}


def _log_missed(
    maps: Sequence[ErrorMap], tables: Sequence[ErrorTable], columns: Mapping[str, Array]
) -> tuple[Array, Certificate]:
    """Return ln of the exact F'_ior over that of the tables, shape (torques, drives), and the proof of the exact one.

    columns: values of the deviations of the compared drives by path, shape (drives,) each.
    """
    log_missed = []
    proof = EMPTY
    for error_map, table in zip(maps, tables, strict=True):
        # the same search that samples have
        exact = many_extremes(error_map, Batch(error_map.drive, columns), DRAWN_GRIDS)
        log_missed.append(log_error(exact.F_ior_arcsec) - log_error(table.F_ior(columns)))
        proof += exact.certificate
    return np.array(log_missed), proof


def turned_errors(
    F_ior: Array,
    rotations_deg: Sequence[float],
    places: NDArray[np.int64],
) -> Array:
    """Return F'_ior with the wheel turned [arcsec], shape (places, rotations): that of directions less by as much.

    F_ior: as the wheel stands [arcsec], shape (draws, directions).
    rotations_deg: turns of the wheel [deg].
    places: flat places among draws and directions.
    """
    count = F_ior.shape[1]
    # places are flat over draws and directions
    draw, direction = np.divmod(places, count)
    # rounded, so that 120 deg of 36 directions is 12 steps and not 11.999
    steps, fraction = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
    # turning the wheel forwards is turning what stands backwards
    turned = direction[:, None] - steps.astype(int)
    # linear between the two directions beside it
    nearer, farther = (F_ior[draw[:, None], (turned - j) % count] for j in (0, 1))
    return np.asarray((1 - fraction) * nearer + fraction * farther)


@dataclass(frozen=True, eq=False)
class ProposedDeviations:
    """A draw of the open deviations.

    shares: of the probability of each of them, by path.
    density: that they were drawn with, over the prior's; infinite if they were drawn before.
    """

    shares: Mapping[str, float]
    density: float


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Draws of a table from which those near the measured F'_ior are chosen, each in a direction.

    places: flat places among draws and directions, shape (candidates,).
    density: with which each is proposed, over the prior's, shape (candidates,).
    """

    table: TabledErrors
    places: NDArray[np.int64]
    density: Array

    def columns(self, rows: NDArray[np.int64]) -> dict[str, Array]:
        """Return values of the deviations of some candidates by path, shape (rows,) each."""
        return {path: values.ravel()[self.places[rows]] for path, values in self.table.values.items()}


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

    def drawn(self, maps: Sequence[ErrorMap], number: int) -> tuple[list[ProposedDeviations], Certificate]:
        """Return draws of the open deviations near F'_ior as measured, and the proof.

        Importance sampling in two steps: F'_ior of a table proposes _SEARCHED_DRAWS drives, and F'_ior that is searched
        for these chooses among them. A draw that was chosen before has an infinite density, and that one less.

        maps: of a drive with all else, those at the torques of the errors among them.
        number: of the drive.
        Raises UntrustedError if a state cannot be trusted.
        """
        map_of_torque = {
            error_map.M_g: error_map for error_map in maps if any(datum.M_g == error_map.M_g for datum in self.errors)
        }
        # cheap: read from a table
        candidates = self._candidates(map_of_torque, number)
        rng = np.random.default_rng([self.seed, number])
        probability = candidates.density / candidates.density.sum()
        # importance sampling in two stages: by the table, then by the search
        searched = rng.choice(
            len(candidates.places),
            _SEARCHED_DRAWS,
            p=probability,
        )
        F_ior, proof = self._searched(map_of_torque, candidates.columns(searched))
        log = log_likelihood_of_errors(F_ior, *values_of_errors(self.errors))
        likelihood = np.exp(log - log.max())
        # target over proposal
        ratio = likelihood / candidates.density[searched]
        # systematic resampling: as many even steps over the cumulative weight as draws
        even = (rng.random() + np.arange(self.draws)) / self.draws
        steps = np.searchsorted(np.cumsum(ratio / ratio.sum()), even)
        chosen = np.minimum(steps, _SEARCHED_DRAWS - 1)
        places = candidates.places[searched[chosen]]
        # the density of the whole two-stage proposal at the chosen draws
        density = likelihood[chosen] / ratio.mean()
        proposals = self._without_repetition(candidates.table, places, density)
        return proposals, candidates.table.certificate + proof

    def _candidates(self, map_of_torque: Mapping[float, ErrorMap], number: int) -> _Candidates:
        """Return the draws of the table of a drive, with the density by which they are proposed."""
        table = tabled_errors(list(map_of_torque.values()), self.prior, self.effort, [self.seed, number])
        torques = list(map_of_torque)
        # flat places, shape (draws, directions)
        place_of = np.arange(table.F_ior_arcsec[0].size).reshape(len(table.shares), -1)
        places = place_of.ravel() if any_direction(self.prior) else place_of[:, 0]
        # F'_ior at each measured value's torque and turn, shape (places, 1) each
        as_measured = [
            turned_errors(table.F_ior_arcsec[torques.index(datum.M_g)], [datum.rotation_deg], places)
            for datum in self.errors
        ]
        log = log_likelihood_of_errors(np.hstack(as_measured), *values_of_errors(self.errors), _READ_ERROR)
        likelihood = np.exp(log - log.max())
        # a floor, since a table may miss what the search finds
        density = _LEAST_PROPOSED + (1 - _LEAST_PROPOSED) * likelihood / likelihood.mean()
        return _Candidates(
            table=table,
            places=places,
            density=density,
        )

    def _searched(
        self, map_of_torque: Mapping[float, ErrorMap], columns: Mapping[str, Array]
    ) -> tuple[Array, Certificate]:
        """Return F'_ior of drives as it was measured [arcsec], shape (drives, values), and the proof of the search.

        columns: values of the deviations by path, shape (drives,) each.
        """
        F_ior = []
        proof = EMPTY
        for datum in self.errors:
            error_map = map_of_torque[datum.M_g]
            drive = error_map.drive
            turned = {
                path: columns.get(path, drive.number(path)) + np.full(_SEARCHED_DRAWS, datum.rotation_deg)
                for path in carried(drive)
            }
            extremes = many_extremes(error_map, Batch(drive, {**columns, **turned}), DRAWN_GRIDS)
            F_ior.append(extremes.F_ior_arcsec)
            proof += extremes.certificate
        return np.stack(F_ior, axis=1), proof

    def _without_repetition(
        self,
        table: TabledErrors,
        places: NDArray[np.int64],
        density: Array,
    ) -> list[ProposedDeviations]:
        """Return the chosen draws; one that was chosen again stands once, with the weight of all its repetitions.

        places: of the chosen draws among draws and directions of the table, shape (chosen,).
        density: of each of them, over the prior's, shape (chosen,).
        """
        proposals = []
        for k, place in enumerate(places):
            # an infinite density gives the repeated draw a weight of 0
            repetitions = np.inf if place in places[:k] else 1 / np.count_nonzero(places == place)
            shares = self._shares_at(table, place)
            proposals.append(ProposedDeviations(shares=shares, density=float(density[k] * repetitions)))
        return proposals

    def _shares_at(self, table: TabledErrors, place: np.int64) -> dict[str, float]:
        """Return the shares of the open deviations at a flat place among draws and directions, by path."""
        draw, direction = np.divmod(place, table.F_ior_arcsec.shape[2])
        fields = open_deviations(self.prior)
        paths = [field_prior.path for field_prior in fields]
        shares = dict(
            zip(
                paths,
                table.shares[draw].tolist(),
                strict=True,
            )
        )
        if any_direction(self.prior):
            standing = _standing_directions(self.prior.drive)
            for field_prior in fields:
                if field_prior.path in standing:
                    shares[field_prior.path] = table.values[field_prior.path][draw, direction] / field_prior.high % 1
        return shares


def _standing_directions(drive: Drive) -> tuple[str, ...]:
    """Return the paths of the directions of deviations that stand with the fixed wheel."""
    turn = standing_offset(drive)[1]
    return (turn,) if drive.mounting.fixed == "flexspline" else (turn, _OVALITY)


def _draws(
    prior: DrivePrior,
    count: int,
    seed: list[int],
    paths: tuple[str, ...] = (),
) -> tuple[Array, dict[str, Array]]:
    """Return draws of the open deviations: shares of their probability, and values by path, shape (draws, directions).

    What stands is turned by equal steps. A prior without open deviations has one draw.

    prior: of the drive.
    count: number of draws if each counts in every direction.
    seed: of the draws.
    paths: of further fields, known by this prior.
    """
    drive = prior.drive
    directions = _directions_of(drive)
    is_any_direction = any_direction(prior)
    fields = open_deviations(prior)
    standing = _standing_directions(drive)
    if not fields:
        count = 1
    elif not is_any_direction:
        count *= _KNOWN_DIRECTION
    shares = sobol_points(2 ** int(np.ceil(np.log2(count))), len(fields), seed)
    values = {path: np.full(len(shares), drive.number(path)) for path in (*standing_offset(drive), *standing, *paths)}
    values |= {field_prior.path: field_prior.value(shares[:, k]) for k, field_prior in enumerate(fields)}
    if is_any_direction:  # each direction has its own part of the turn
        values[standing[0]] = values[standing[0]] / directions
    turns_deg = 360 / directions * np.arange(directions)
    columns = {}
    for path, of_draws in values.items():
        if path in standing:
            columns[path] = np.add.outer(of_draws, turns_deg) % 360
        else:
            columns[path] = np.repeat(
                of_draws[:, None],
                directions,
                axis=1,
            )
    return shares, columns
