"""Samples of the belief in a drive before any trial, in all positions of its seat.

Stiffnesses, clearances and the wave of a sample cost a table of the error (error/table.py); deviations are read off it.
So each draw of the former is taken with many draws of the latter. Turning the wheel forward is turning back all that
stands: a sample whose offset points one step further has, one position further, the F'_ior of the sample before it. So
where the direction of what stands is open every sample counts in all directions, and all positions of it cost one
F'_ior each.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.evidence import (
    ACCURACY,
    Evidence,
    evidence_of,
    log_likelihood,
    measured_errors,
    values_of_errors,
)
from hdassist.belief.misfit import log_likelihood_of_errors
from hdassist.belief.prior import DrivePrior, FieldPrior, owner_of, prior_of
from hdassist.belief.samples import COARSE_POINTS, HOPELESS, conflict_of, going_on
from hdassist.belief.sobol import sobol_points
from hdassist.belief.statistics import effective_number, log_error
from hdassist.error.error_map import Batch, ErrorMap, searchable
from hdassist.error.table import TABLE_SECTIONS, ErrorTable, Mesh, Reach, error_table
from hdassist.errors import HdassistError, UntrustedError, UsageError
from hdassist.model.contacts import contact_system
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.trial import Trial
from hdassist.preset.fields import Drive, deviation_sizes, measures
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.solve.formulation import formulate
from hdassist.solve.window import in_wide_enough_window

Places = NDArray[np.int64]

WIDEST_SIZE = 2.0  # a size without an uncertainty may be so many times the preset's
FINEST, COARSEST = 36, 8  # directions that a sample is taken in, at most and at least
KNOWN_DIRECTION = 8  # times as many deviations where they count in one direction alone
OVALITY = "harmonics.xi_s2"  # direction of what the seat does to the rigid wheel; stands still where that is fixed


@dataclass(frozen=True)
class Rig:
    """How trials are measured: at a torque [N*m], with noise [arcsec], the standard deviation of a value.

    That of mounting the wheel again included. Raises UsageError unless the torque turns something and the noise is one.
    """

    M_g: float
    noise_arcsec: float = 1.0

    def __post_init__(self) -> None:
        # beyond that, squares are no numbers
        if not (0 < abs(self.M_g) <= 1e7 and 1e-6 <= self.noise_arcsec <= 1e6):
            stated = f"{self.M_g:g} N*m, noise {self.noise_arcsec:g} arcsec"
            wanted = "expected a torque up to 1e7 N*m but 0, and a noise above 0"
            raise UsageError(f"invalid trials: {stated}: {wanted}", "--trial-torque 80")


COMPARED = 16  # drives with a table of one system, to see what it misses
TRIAL_MESH = Mesh((13, 5, 9, 9), 16)  # misses F'_ior of vzp160 by 3 %, beside their mean


@dataclass(frozen=True)
class TrialEffort:
    """Effort of the samples of trials.

    systems: effective draws of stiffnesses, clearances and the wave, at least and at most; batch, of them at a time;
    draws of them at most; deviations: draws of them with each; mesh of the tables; compared: drives of each of which
    F'_ior is searched for too; effective: samples that have to explain the trials.
    """

    systems: int = 32
    most_systems: int = 128
    batch: int = 16
    most_draws: int = 2048
    deviations: int = 32
    mesh: Mesh = TRIAL_MESH
    compared: int = 1
    effective: int = 64

    @classmethod
    def of(cls, systems: int) -> TrialEffort:
        """The effort for so many effective systems, at most four times as many."""
        return cls(systems, 4 * systems, min(16, systems), 64 * systems)

    @property
    def of_one_system(self) -> TrialEffort:
        """As many samples where nothing but deviations is unknown, from finer tables."""
        every, some = self.systems * self.deviations, min(COMPARED, self.systems)
        return replace(self, systems=1, most_systems=8, batch=1, deviations=every, mesh=Mesh(), compared=some)


TRIAL_EFFORT = TrialEffort()


@dataclass(frozen=True, eq=False)
class Prior:
    """Samples of a drive, and their F'_ior [arcsec] with what stands turned in steps, on a rig.

    F_ior_by_torque [arcsec] by M_g [N*m], and weight, which sums to 1, of shape (samples, directions) each;
    read_error, relative standard deviation of it, by M_g; values of the offset that stands with the wheel by field,
    shape (samples, directions); systems, effective number of them; seed.
    """

    drive: Drive
    rig: Rig
    F_ior_by_torque: Mapping[float, Array]
    weight: Array
    values: Mapping[str, Array]
    read_error: Mapping[float, float]
    systems: float = 0.0
    seed: int = 0
    certificate: Certificate = EMPTY

    @property
    def M_g(self) -> float:
        """Torque of the trials [N*m]."""
        return self.rig.M_g

    @property
    def F_ior_arcsec(self) -> Array:
        """F'_ior [arcsec] at the torque of the trials with the wheel at 0, shape (samples, directions)."""
        return self.F_ior_by_torque[self.M_g]

    @property
    def possible(self) -> Places:
        """Flat places among samples and directions that weigh anything."""
        return np.flatnonzero(self.weight)

    def at(self, rotations_deg: Sequence[float], places: Places | None = None, M_g: float | None = None) -> Array:
        """F'_ior [arcsec] with the wheel turned, shape (places, rotations): that of directions less by as much.

        Arguments: flat places among samples and directions, all of them without it; M_g [N*m], another torque.
        """
        F_ior, count = self.F_ior_by_torque[self.M_g if M_g is None else M_g], self.weight.shape[1]
        sample, direction = np.divmod(np.arange(self.weight.size) if places is None else places, count)
        whole, part = np.divmod(np.round(np.multiply(rotations_deg, count) / 360, 9), 1)
        turned = direction[:, None] - whole.astype(int)
        here, beside = (F_ior[sample[:, None], (turned - j) % count] for j in (0, 1))
        return np.asarray((1 - part) * here + part * beside)

    def offset(self, places: Places) -> tuple[Array, Array]:
        """Size [um] and direction [deg] of the offset that stands with the fixed wheel, shape (places,) each."""
        size, direction = (self.values[path].ravel()[places] for path in standing_offset(self.drive))
        return size, direction

    def noise(self, trials: Sequence[Trial]) -> Array:
        """Standard deviations of measured values as stated [arcsec], shape (trials,): their own, or that of all."""
        own = [self.rig.noise_arcsec if each.noise_arcsec is None else each.noise_arcsec for each in trials]
        return np.array(own, dtype=float)


@dataclass(frozen=True, eq=False)
class _System:
    """One draw of stiffnesses, clearances and the wave with its draws of deviations, or why it is no drive.

    F_ior, shape (torques, deviations, directions), and log_missed, logarithm of the exact F'_ior of some of them
    over that, shape (torques, compared); weight, shape (deviations, directions); values as of Prior.
    """

    refused: str = ""
    weight: Array = field(default_factory=partial(np.zeros, (0, 0)))
    F_ior: Array = field(default_factory=partial(np.zeros, (0, 0, 0)))
    log_missed: Array = field(default_factory=partial(np.zeros, (0, 0)))
    values: Mapping[str, Array] | None = None
    certificate: Certificate = EMPTY


def trial_states(drive: Drive, torques: int, effort: TrialEffort = TRIAL_EFFORT) -> int:
    """Number of states that the samples of trials solve, about, for a progress bar."""
    return effort.systems * torques * (effort.mesh.states(drive) + 2 * COARSE_POINTS**2)


def trial_prior(
    drive: Drive,
    torques: Sequence[float],
    rig: Rig,
    *,
    effort: TrialEffort = TRIAL_EFFORT,
    enough: Callable[[Prior], bool] = lambda _prior: True,
    run: Run = Run(),
) -> Prior:
    """Samples of all that is not known of a drive, its standing offset among it, by the preset's evidence.

    Arguments: torques [N*m] beside the rig's; effort; enough, whether the samples suffice, else more are drawn, up to
    the effort's limits; run, its seed among it. Raises UsageError for a drive with rolling balls or without an offset,
    UntrustedError where too few draws are drives that agree with the evidence.
    """
    if not searchable(drive):
        raise UsageError("trials need locked balls", "bearing.ball_motion: locked")
    belief, evidence = open_prior(drive), evidence_of(drive)
    if all(each.path.startswith(TABLE_SECTIONS) for each in belief.fields):
        effort = effort.of_one_system
    every = tuple(dict.fromkeys((rig.M_g, *torques, *(each.M_g for each in measured_errors(drive)))))
    solve = partial(_solved, belief, evidence, every, effort, run.seed)
    systems: list[_System] = []
    while True:
        first = len(systems)
        numbers = range(first, min(first + effort.batch, effort.most_draws))
        shares = belief.shares(numbers.stop, run.seed)[first:]
        for each in run.map(solve, numbers, belief.values(shares), shares[:, -1].tolist()):
            systems.append(each)
            run.solved(each.certificate.states)
        prior = _collected(drive, rig, every, systems, run.seed)
        is_last = len(systems) >= effort.most_draws or (len(systems) >= HOPELESS and not prior.systems)
        if prior.systems >= effort.systems and (is_last or prior.systems >= effort.most_systems or enough(prior)):
            return prior
        if is_last:
            break
    found = f"{prior.systems:.0f} of {len(systems)} draws are effective, {effort.systems} are needed"
    refused = Counter(each.refused for each in systems if each.refused).most_common(1)
    reason = f": most are no drive ({refused[0][0]})" if refused else ": the catalogue's values contradict each other"
    raise UntrustedError(found + reason, "hdassist check says which value to look at")


def _collected(drive: Drive, rig: Rig, torques: tuple[float, ...], systems: Sequence[_System], seed: int) -> Prior:
    """Samples of all systems that are drives, F'_ior by tables made up for what these miss on the mean."""
    kept = [each for each in systems if each.weight.any()]
    proof = sum((each.certificate for each in systems), EMPTY)
    if not kept:
        return Prior(drive, rig, {}, np.zeros((0, 0)), {}, {}, certificate=proof)
    log_missed = np.concatenate([each.log_missed for each in kept], axis=1)
    F_ior = np.concatenate([each.F_ior for each in kept], axis=1) * np.exp(log_missed.mean(axis=1))[:, None, None]
    weight = np.concatenate([each.weight for each in kept])
    values = {path: np.concatenate([(each.values or {})[path] for each in kept]) for path in standing_offset(drive)}
    effective = effective_number(np.array([each.weight.sum() for each in kept]))
    prior = Prior(
        drive, rig, dict(zip(torques, F_ior, strict=True)), weight / weight.sum(), values,
        dict(zip(torques, log_missed.std(axis=1).tolist(), strict=True)), effective, seed, proof,
    )  # fmt: skip
    return _weighed(prior)


def _weighed(prior: Prior) -> Prior:
    """Samples weighed by F'_ior that the preset has as measured at other torques than that of the trials."""
    errors = [each for each in measured_errors(prior.drive) if each.M_g != prior.M_g]
    if not errors:
        return prior
    weight = prior.weight.ravel().copy()
    f = np.hstack([prior.at([each.rotation_deg], prior.possible, each.M_g) for each in errors])
    log = log_likelihood_of_errors(f, *values_of_errors(errors))
    weight[prior.possible] *= np.exp(log - log.max())
    return replace(prior, weight=(weight / weight.sum()).reshape(prior.weight.shape))


def directions_of(drive: Drive) -> int:
    """Number of directions that samples are taken in: the seat's holes, or some of each."""
    holes = drive.mounting.holes
    return holes * -(-COARSEST // holes) if 0 < holes <= FINEST else FINEST


def any_direction(belief: DrivePrior) -> bool:
    """Whether every direction of what stands is equally likely; else samples count in the one that they have.

    A standing ovality whose direction is known does not turn with the offset.
    """
    drive, known = belief.drive, {each.path: each for each in belief.fields}
    turn = known.get(standing_offset(drive)[1])
    oval = drive.mounting.fixed == "rigid" and drive.value("harmonics.a_s2") != 0 and OVALITY not in known
    return turn is not None and turn.distribution == "even" and turn.high - turn.low == 360 and not oval


def open_prior(drive: Drive) -> DrivePrior:
    """The prior of a drive, as `check` has it, with the offset that stands with the fixed wheel open.

    That offset is anywhere up to WIDEST times the preset's, in any direction, unless the preset gives an uncertainty
    for it or does not know it; so is the one that turns with the cam. Raises UsageError where nothing is known of the
    size of the standing offset.
    """
    belief, (size, direction), own = prior_of(drive), standing_offset(drive), "tolerances.e_hh"
    known = {each.path: each for each in belief.fields}
    if size not in known and not drive.number(size) > 0:
        raise UsageError(
            f"unknown size of the cam offset: {size}",
            f"--set {size}=80 says that up to {WIDEST_SIZE:g} times 80 um are likely",
        )
    pairs = [(size, direction)]
    if drive.number(own) or any(path not in (size, direction) for path in drive.uncertainty):
        pairs.append((own, "phases.phi_hh"))
    for group, turn in pairs:
        reason = f"open in trials: up to {WIDEST_SIZE:g} times the preset's"
        if group not in known:
            most = WIDEST_SIZE * drive.number(group)
            known[group] = FieldPrior(group, "even", 0.0, most, owner_of(drive, group), group, reason)
        if turn not in known:
            known[turn] = FieldPrior(turn, "even", 0.0, 360.0, owner_of(drive, turn), group, "any direction")
    fields = tuple(known[path] for path in measures() if path in known and known[path].low < known[path].high)
    return replace(belief, fields=fields)


def _solved(
    belief: DrivePrior,
    evidence: tuple[Evidence, ...],
    torques: tuple[float, ...],
    effort: TrialEffort,
    seed: int,
    number: int,
    values: dict[str, float],
    chance: float,
) -> _System:
    """A system by its number among the draws, with values of its fields: evidence of stiffness first, then tables."""
    own = {path: value for path, value in values.items() if not path.startswith(TABLE_SECTIONS)}
    if refused := conflict_of(belief.drive, own):
        return _System(refused)
    moved, proof = belief.drive.with_values(own), EMPTY
    try:
        figures, probability, proof = going_on(moved, evidence)
        if chance >= probability:
            return _System(certificate=proof)
        weight = float(np.exp(log_likelihood(evidence, figures))) / probability
        columns = _deviations(belief, effort.deviations, [seed, number])
        sizes = {path: float(column.max()) for path, column in columns.items() if path in deviation_sizes()}
        tabled = partial(_tables, torques=torques, sizes=sizes, columns=columns, effort=effort, number=number)
        tables, log_missed, found = in_wide_enough_window(moved, tabled)
        flat = {path: column.ravel() for path, column in columns.items()}
        shape = next(iter(columns.values())).shape
        F_ior = np.array([table.F_ior(flat).reshape(shape) for table in tables])
    except HdassistError as error:
        return _System(str(error.fault), certificate=proof)
    weights = np.full(shape, weight)
    limits = [each for each in evidence if each.figure == ACCURACY]
    for each in limits:  # of accuracy without load, where F'_ior is greatest: that of the trials keeps it too
        weights *= np.exp(each.log_likelihood(F_ior[0]))
    if not any_direction(belief):
        weights[:, 1:] = 0
    offset = {path: columns[path] for path in standing_offset(moved)}
    return _System("", weights, F_ior, log_missed, offset, proof + found)


def _deviations(belief: DrivePrior, count: int, seed: list[int]) -> dict[str, Array]:
    """Draws of the deviations that are not known, by path, with what stands turned, shape (draws, directions)."""
    drive, directions, every = belief.drive, directions_of(belief.drive), any_direction(belief)
    fields = [each for each in belief.fields if each.path.startswith(TABLE_SECTIONS)]
    count = 2 ** int(np.ceil(np.log2(count if every else count * KNOWN_DIRECTION)))
    shares = sobol_points(count, len(fields), seed)
    turn = standing_offset(drive)[1]
    stand = [turn] if drive.mounting.fixed == "flexspline" else [turn, OVALITY]
    drawn = {path: np.full(count, drive.number(path)) for path in standing_offset(drive)}
    drawn |= {path: np.full(count, drive.number(path)) for path in stand}
    drawn |= {each.path: each.value(shares[:, k]) for k, each in enumerate(fields)}
    if every:  # of each direction its own part of the turn
        drawn[turn] = drawn[turn] / directions
    turned = 360 / directions * np.arange(directions)
    return {path: np.add.outer(of, turned) % 360 if path in stand else np.repeat(of[:, None], directions, axis=1)
            for path, of in drawn.items()}  # fmt: skip


def _tables(
    drive: Drive,
    torques: tuple[float, ...],
    sizes: Mapping[str, float],
    columns: Mapping[str, Array],
    effort: TrialEffort,
    number: int,
) -> tuple[list[ErrorTable], Array, Certificate]:
    """Tables of a system at torques [N*m], what they miss of some of its drives, in the logarithm, and their proof."""
    reach, formulation = Reach.of(drive.with_values(sizes)), formulate(contact_system(drive))
    rows = np.arange(effort.compared)
    some = {path: column[rows, (number + 5 * rows) % column.shape[1]] for path, column in columns.items()}
    maps = [ErrorMap(drive, M_g, formulation) for M_g in torques]
    # first, for it tells soon where the flank window is too narrow
    exact = [error_map.many_extremes(Batch(drive, some), grid=COARSE_POINTS) for error_map in maps]
    tables = [error_table(error_map, reach, effort.mesh) for error_map in maps]
    log_missed = [
        log_error(known.F_ior_arcsec) - log_error(table.F_ior(some)) for known, table in zip(exact, tables, strict=True)
    ]
    return (
        tables,
        np.array(log_missed),
        sum((each.certificate for each in tables), sum((each.certificate for each in exact), EMPTY)),
    )
