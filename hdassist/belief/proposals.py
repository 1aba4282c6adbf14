"""Draws closer to the reference data: for stiffness by the field most affected, for F'_ior by tables of the error.

Importance sampling: the weight of each draw is divided by the density with which it was drawn, so that weighted
statistics remain those of prior and reference data. The density is nowhere below a share of that of the prior.

A table (drive/error/error_map.py) takes as long as some searches, and reading a drive from it almost no time. Turning
the wheel forwards is equivalent to turning all stationary deviations backwards. Therefore F'_ior of a draw whose
eccentricity points one step further equals, one position further, that of the original draw. Each draw is read with the
stationary deviations in all directions, and each of its positions takes only one reading.
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
from hdassist.drive.error.error_map import TABLE_SECTIONS, Batch, ErrorMap, ErrorTable, Mesh, Reach, error_table
from hdassist.drive.error.extremes import DRAWN_GRIDS, many_extremes
from hdassist.drive.error.readings import position_states
from hdassist.drive.model.deviations import carried, standing_offset
from hdassist.drive.model.geometry import Array
from hdassist.drive.preset.fields import Drive, deviation_sizes
from hdassist.drive.solve.answers import EMPTY, Certificate

_Pilot = Sequence[Mapping[str, float]]  # figures of the first draws, by name
PILOT_DRAWS = 64  # number of draws from the prior, from which the proposal of further draws is derived
_CELLS = 16  # number of equal parts of the field's probability with constant density
LEAST_DENSITY = 0.15  # smallest density of a proposal over that of the prior
_CHANCE_OF_STEERING = 0.01  # probability that any field seems affected although the reference data affect none


@dataclass(frozen=True)
class Proposal:
    """A density over the probability of a field, in equal cells, with mean 1.

    field: index of the field in the prior.
    """

    field: int
    density: tuple[float, ...]

    def drawn(self, shares: Array) -> tuple[Array, Array]:
        """Return draws of the prior transformed to this density, and the density at each of them.

        shares: quantile levels of the prior's draws, shape (draws, at least fields); the result has the same shape.
        """
        cells = len(self.density)
        # inverse distribution function: equal input steps give output steps according to the density
        edges = np.cumsum((0.0, *self.density)) / cells  # probability of the density below each edge of a cell
        moved = shares.copy()
        moved[:, self.field] = np.interp(shares[:, self.field], edges, np.linspace(0, 1, cells + 1))
        # the weight of a draw is divided by its density, so the prior is unchanged
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
    """Return draws and their density relative to that of the prior, shape (draws,).

    A draw is the quantile level of each field, followed by one more random number.

    prior: prior of the drive.
    evidence: reference data on the drive.
    pilot: predicted values of the first draws, PILOT_DRAWS of them if `first` is at least that number.
    first, last: number of the first draw, and number after the last draw.
    seed: seed of the draws.
    """
    shares = prior.shares(last, seed)
    # fields of a fit are drawn jointly
    independent = [k for k, field_prior in enumerate(prior.fields) if not field_prior.draws]
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
    """Return the proposal from the stiffness of the first draws; None if no single field explains it.

    The field is the one whose quantile level x, with its square, explains most of the log likelihood in a regression.
    The density follows from the weighted draws by Legendre's first two polynomials.

    shares: quantile levels of the first draws, including those that were not solved further, shape (draws, at least
        fields).
    evidence: reference data on the drive.
    pilot: predicted values of these draws.
    """
    # stiffness follows from the contact system alone, before any error is solved
    log_of_draw = stiffness_log_likelihoods(evidence, pilot)
    draws = list(log_of_draw)
    y = np.array(list(log_of_draw.values()))
    # too few valid drives in the pilot, or reference data that all of them meet equally
    if len(y) < PILOT_DRAWS / 2 or np.ptp(y) == 0:
        return None
    x = 2 * shares[draws, :-1] - 1
    # find the single field that explains most of the log likelihood
    unexplained = np.array([_unexplained_share(column, y) for column in x.T])
    field = int(np.argmin(unexplained))
    free = len(y) - 3  # degrees of freedom apart from the mean, the share and its square
    # F test of the parabola with 2 and `free` degrees of freedom
    F_ratio = (1 / unexplained[field] - 1) * free / 2
    # divided by the number of fields, because the best of many is tested
    if fdtrc(2, free, F_ratio) > _CHANCE_OF_STEERING / len(unexplained):
        return None
    # posterior moments of this field, over the pilot
    weights = np.exp(y) / np.exp(y).sum()
    mean = weights @ x[:, field]
    mean_square = weights @ x[:, field] ** 2
    return Proposal(field, _legendre_density(mean, mean_square))


def _legendre_density(mean: float, mean_square: float) -> tuple[float, ...]:
    """Return a density over -1 to 1 in equal cells from the moments of x, with mean 1 and at least LEAST_DENSITY.

    p(x) = 1 + 3 E[P_1] P_1(x) + 5 E[P_2] P_2(x), with P_1 = x and P_2 = (3 x^2 - 1)/2.
    """
    middles = 2 * (np.arange(_CELLS) + 0.5) / _CELLS - 1
    # Legendre polynomials 1, x and (3 x^2 - 1)/2 with the given moments
    series = 1 + 3 * mean * middles + 5 / 4 * (3 * mean_square - 1) * (3 * middles**2 - 1)
    density = np.maximum(series, 0)
    # the smallest density bounds the weights: no sample has a weight above 1/LEAST_DENSITY
    return tuple((LEAST_DENSITY + (1 - LEAST_DENSITY) * density / density.mean()).tolist())


def stiffness_log_likelihoods(evidence: tuple[Evidence, ...], pilot: _Pilot) -> dict[int, float]:
    """Return the log likelihood of the stiffness of each pilot draw, by index.

    Draws without stiffness figures are omitted.
    """
    log_of_draw = {}
    for place, figures in enumerate(pilot):
        # a draw that is not a valid drive has no figures
        if figures.keys() >= {*STIFFNESS_FIGURES}:
            stiffness = {name: figures[name] for name in STIFFNESS_FIGURES}
            log_of_draw[place] = log_likelihood(evidence, stiffness)
    return log_of_draw


def _unexplained_share(x: Array, y: Array) -> float:
    """Return the share of the variance of y that a parabola in x does not explain."""
    return float(np.var(y - np.polyval(np.polyfit(x, y, 2), x)) / np.var(y))


_FINEST = 36  # largest number of directions in which a draw is read
_COARSEST = 8  # smallest number of directions in which a draw is read
_KNOWN_DIRECTION = 8  # factor for the number of draws if each counts in only one direction
# direction of the ovality that the seat causes in the circular spline, stationary if that wheel is fixed
_OVALITY = "harmonics.xi_s2"
_SEARCHED_DRAWS = 20  # number of draws of a drive found by search, from which some are chosen
_READ_ERROR = 0.1  # relative error of F'_ior from a table, in the likelihood with which a draw is proposed
_LEAST_PROPOSED = 0.1  # smallest density of the proposal of a draw over that of the prior


@dataclass(frozen=True)
class TableEffort:
    """Number of draws of the deviations, mesh of the table, and number of drives searched to measure its error.

    The usual mesh has an F'_ior error of 3 % for vzp160, apart from its mean.
    """

    deviations: int = 64
    mesh: Mesh = field(default_factory=partial(Mesh, (9, 5, 7, 7), 16))
    compared: int = 1


@dataclass(frozen=True, eq=False)
class TabledErrors:
    """F'_ior of draws of the deviations of a drive, with the stationary deviations turned in equal steps.

    F_ior_arcsec: F'_ior [arcsec], shape (torques, draws, directions).
    tested_arcsec: reading of an accuracy test at the first torque [arcsec], shape (draws, directions).
    log_missed: logarithm of exact F'_ior over that of the table, for some draws, shape (torques, compared).
    values: values of the deviations by path, shape (draws, directions) each.
    shares: quantile levels of the uncertain deviations, shape (draws, fields).
    """

    F_ior_arcsec: Array
    tested_arcsec: Array
    log_missed: Array
    values: Mapping[str, Array]
    shares: Array
    certificate: Certificate


def open_deviations(prior: DrivePrior) -> tuple[FieldPrior, ...]:
    """Return the uncertain deviations of a prior, which are the fields that a table spans."""
    return tuple(field_prior for field_prior in prior.fields if field_prior.path.startswith(TABLE_SECTIONS))


def _directions_of(drive: Drive) -> int:
    """Return the number of directions in which draws are read, a multiple of the seat's holes if these are few."""
    holes = drive.mounting.holes
    # whole directions for each hole, so that reading in holes needs no interpolation
    return holes * -(-_COARSEST // holes) if 0 < holes <= _FINEST else _FINEST


def any_direction(prior: DrivePrior) -> bool:
    """Return whether every direction of the stationary deviations is equally probable.

    If so, each draw is evaluated in every direction; if not, only in the direction with which it was drawn. A
    stationary ovality of known direction gives False, because it does not rotate with the eccentricity.
    """
    drive = prior.drive
    prior_of_path = {field_prior.path: field_prior for field_prior in prior.fields}
    # if the direction is unknown, one drive serves in every direction
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
    """Return draws of the deviations that a prior leaves open, with their F'_ior on the system of a drive.

    maps: error maps of the drive, one per torque.
    prior: prior of the deviations.
    effort: effort for the table.
    seed: seed of these draws, whose last number is that of the drive among others.
    other: a prior from which fewer draws follow these, each of which counts only in its own direction.

    Raises UntrustedError if a state cannot be trusted.
    """
    shares, columns = _draws(prior, effort.deviations, seed)
    # draws in a single direction, from the same fields
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
    error_map: ErrorMap,
    table: ErrorTable,
    columns: Mapping[str, Array],
    F_ior: Array,
    seed: Sequence[int],
) -> Array:
    """Return the readings of an accuracy test [arcsec], shape (draws,).

    columns: values of the deviations by path, shape (draws,) each.
    F_ior: F'_ior over the full mesh cycle [arcsec], shape (draws,).
    seed: seed of the first positions.
    """
    positions = tested_positions(error_map.drive.catalogue.accuracy_test)
    if not positions:
        return F_ior
    starts = np.random.default_rng([*seed, positions]).random(len(F_ior))
    return table.ranges(columns, position_states(error_map, positions, starts))


def _tables(
    maps: Sequence[ErrorMap],
    columns: Mapping[str, Array],
    mesh: Mesh,
) -> list[ErrorTable]:
    """Return tables of the error, one per torque, that span the largest deviations of the draws."""
    # the table spans the largest drawn size in any direction
    largest = {path: float(values.max()) for path, values in columns.items() if path in deviation_sizes()}
    reach = Reach.of(maps[0].drive.with_values(largest))
    return [error_table(error_map, reach, mesh) for error_map in maps]


def _compared_columns(
    columns: Mapping[str, Array],
    count: int,
    number: int,
) -> dict[str, Array]:
    """Return the values of the first draws by path, shape (count,) each, each draw in a different direction.

    columns: values by path, shape (draws, directions).
    number: number of the drive, which selects the direction of its first draw.
    """
    rows = np.arange(count)
    # steps of five directions distribute the drives over the seat
    return {path: values[rows, (number + 5 * rows) % values.shape[1]] for path, values in columns.items()}


def _log_missed(
    maps: Sequence[ErrorMap],
    tables: Sequence[ErrorTable],
    columns: Mapping[str, Array],
) -> tuple[Array, Certificate]:
    """Return the log ratio of exact F'_ior to that of the tables, shape (torques, drives), and the certificate.

    columns: values of the deviations of the compared drives by path, shape (drives,) each.
    """
    log_missed = []
    proof = EMPTY
    for error_map, table in zip(maps, tables, strict=True):
        # the same search as for samples
        exact = many_extremes(error_map, Batch(error_map.drive, columns), DRAWN_GRIDS)
        log_missed.append(log_error(exact.F_ior_arcsec) - log_error(table.F_ior(columns)))
        proof += exact.certificate
    return np.array(log_missed), proof


def turned_errors(
    F_ior: Array,
    rotations_deg: Sequence[float],
    places: NDArray[np.int64],
) -> Array:
    """Return F'_ior with the wheel turned [arcsec], shape (places, rotations).

    A rotation of the wheel is equivalent to the opposite rotation of the directions.

    F_ior: F'_ior in the present position [arcsec], shape (draws, directions).
    rotations_deg: rotations of the wheel [deg].
    places: flat indices into draws and directions.
    """
    count = F_ior.shape[1]
    # places are flat indices into draws and directions
    draw, direction = np.divmod(places, count)
    # rounded, so that 120 deg out of 36 directions is 12 steps and not 11.999
    steps, fraction = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
    # turning the wheel forwards is equivalent to turning the stationary deviations backwards
    turned = direction[:, None] - steps.astype(int)
    # linear interpolation between the two nearest directions
    nearer, farther = (F_ior[draw[:, None], (turned - j) % count] for j in (0, 1))
    return np.asarray((1 - fraction) * nearer + fraction * farther)


@dataclass(frozen=True, eq=False)
class ProposedDeviations:
    """A draw of the uncertain deviations.

    shares: quantile level of each deviation, by path.
    density: density with which the draw was made, relative to that of the prior; infinite for a repeated draw.
    """

    shares: Mapping[str, float]
    density: float


@dataclass(frozen=True, eq=False)
class _Candidates:
    """Draws of a table, each in one direction, from which those near the measured F'_ior are chosen.

    places: flat indices into draws and directions, shape (candidates,).
    density: density with which each is proposed over that of the prior, shape (candidates,).
    """

    table: TabledErrors
    places: NDArray[np.int64]
    density: Array

    def columns(self, rows: NDArray[np.int64]) -> dict[str, Array]:
        """Return values of the deviations of the selected candidates by path, shape (rows,) each."""
        return {path: values.ravel()[self.places[rows]] for path, values in self.table.values.items()}


@dataclass(frozen=True)
class DeviationProposal:
    """Draws of the deviations near the measured F'_ior.

    Importance sampling: a draw is chosen by its likelihood with F'_ior from a table, and its weight is divided by the
    density with which it was chosen, so that weighted statistics remain those of prior and reference data. Several
    draws share all other fields of a drive, because its table takes longer than they do.

    errors: measured values of F'_ior.
    draws: number of draws per drive.
    """

    prior: DrivePrior
    errors: tuple[Evidence, ...]
    seed: int
    effort: TableEffort = field(default_factory=partial(TableEffort, 64, Mesh((9, 5, 5, 5), 12), 0))
    draws: int = 4

    def drawn(self, maps: Sequence[ErrorMap], number: int) -> tuple[list[ProposedDeviations], Certificate]:
        """Return draws of the open deviations near the measured F'_ior, and the certificate.

        Importance sampling in two steps: F'_ior from a table proposes _SEARCHED_DRAWS drives, and their F'_ior from a
        search selects some of them. A repeated draw has an infinite density, and the density of the first one is
        smaller accordingly.

        maps: error maps of a drive with all other fields, including those at the torques of the measured values.
        number: number of the drive.

        Raises UntrustedError if a state cannot be trusted.
        """
        map_of_torque = {
            error_map.M_g: error_map for error_map in maps if any(datum.M_g == error_map.M_g for datum in self.errors)
        }
        # readings from a table take little time
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
        # target density over proposal density
        ratio = likelihood / candidates.density[searched]
        # systematic resampling: as many even steps over the cumulative weight as draws
        even = (rng.random() + np.arange(self.draws)) / self.draws
        steps = np.searchsorted(np.cumsum(ratio / ratio.sum()), even)
        chosen = np.minimum(steps, _SEARCHED_DRAWS - 1)
        places = candidates.places[searched[chosen]]
        # density of the two-stage proposal at the chosen draws
        density = likelihood[chosen] / ratio.mean()
        proposals = self._without_repetition(candidates.table, places, density)
        return proposals, candidates.table.certificate + proof

    def _candidates(self, map_of_torque: Mapping[float, ErrorMap], number: int) -> _Candidates:
        """Return the draws of the table of a drive, with the density with which they are proposed."""
        table = tabled_errors(list(map_of_torque.values()), self.prior, self.effort, [self.seed, number])
        torques = list(map_of_torque)
        # flat indices, shape (draws, directions)
        place_of = np.arange(table.F_ior_arcsec[0].size).reshape(len(table.shares), -1)
        places = place_of.ravel() if any_direction(self.prior) else place_of[:, 0]
        # F'_ior at the torque and rotation of each measured value, shape (places, 1) each
        as_measured = [
            turned_errors(table.F_ior_arcsec[torques.index(datum.M_g)], [datum.rotation_deg], places)
            for datum in self.errors
        ]
        log = log_likelihood_of_errors(np.hstack(as_measured), *values_of_errors(self.errors), _READ_ERROR)
        likelihood = np.exp(log - log.max())
        # a smallest density, because a table may miss drives that the search finds
        density = _LEAST_PROPOSED + (1 - _LEAST_PROPOSED) * likelihood / likelihood.mean()
        return _Candidates(
            table=table,
            places=places,
            density=density,
        )

    def _searched(
        self, map_of_torque: Mapping[float, ErrorMap], columns: Mapping[str, Array]
    ) -> tuple[Array, Certificate]:
        """Return F'_ior of drives under the conditions of the measured values [arcsec], shape (drives, values).

        The second result is the certificate of the search.

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
        """Return the chosen draws without repetition, each with the total weight of its repetitions.

        places: flat indices of the chosen draws into draws and directions of the table, shape (chosen,).
        density: density of each over that of the prior, shape (chosen,).
        """
        proposals = []
        for k, place in enumerate(places):
            # an infinite density gives a repeated draw a weight of 0
            repetitions = np.inf if place in places[:k] else 1 / np.count_nonzero(places == place)
            shares = self._shares_at(table, place)
            proposals.append(ProposedDeviations(shares=shares, density=float(density[k] * repetitions)))
        return proposals

    def _shares_at(self, table: TabledErrors, place: np.int64) -> dict[str, float]:
        """Return the quantile levels of the deviations of a draw in one direction, by path.

        place: flat index into draws and directions.
        """
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
    """Return the paths of the directions of stationary deviations."""
    turn = standing_offset(drive)[1]
    return (turn,) if drive.mounting.fixed == "flexspline" else (turn, _OVALITY)


def _draws(
    prior: DrivePrior,
    count: int,
    seed: list[int],
    paths: tuple[str, ...] = (),
) -> tuple[Array, dict[str, Array]]:
    """Return draws of the uncertain deviations: their quantile levels, and their values by path.

    The levels have the shape (draws, fields), and each array of values (draws, directions).

    The stationary deviations are turned in equal steps. A prior without open deviations has one draw.

    prior: prior of the drive.
    count: number of draws if each counts in every direction.
    seed: seed of the draws.
    paths: paths of further fields, whose values this prior knows.
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
    values |= DrivePrior(drive, tuple(fields)).columns(shares)
    if is_any_direction:  # each direction has its own part of the revolution
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
