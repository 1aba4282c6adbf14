"""Samples of the belief in a drive before any trial, in all positions of its seat.

Stiffnesses, clearances and the wave are drawn as `check` draws them, by the evidence of stiffness; with each draw of
these F'_ior of many draws of the deviations is read off a table (belief/tabled.py), in all positions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.evidence import ACCURACY, evidence_of, measured_errors, values_of_errors
from hdassist.belief.misfit import log_likelihood_of_errors
from hdassist.belief.prior import DrivePrior, FieldPrior, owner_of, prior_of
from hdassist.belief.samples import Samples, SamplingEffort, draw_samples
from hdassist.belief.tabled import (
    TabledErrors,
    TableEffort,
    any_direction,
    open_deviations,
    tabled_errors,
    turned_errors,
)
from hdassist.error.error_map import error_maps, searchable
from hdassist.error.sloped import DRAWN_STATES
from hdassist.error.table import Mesh
from hdassist.errors import HdassistError, UntrustedError, UsageError
from hdassist.model.deviations import standing_offset
from hdassist.model.geometry import Array
from hdassist.mounting.trial import Trial
from hdassist.preset.fields import Drive, measures
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate

Places = NDArray[np.int64]

WIDEST_SIZE = 2.0  # a size without an uncertainty may be so many times the preset's


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
            stated = f"{self.M_g:g} N*m, noise {self.noise_arcsec:g}″"
            wanted = "expected a torque up to 1e7 N*m but 0, and a noise above 0"
            raise UsageError(f"invalid trials: {stated}: {wanted}", "--trial-torque 80")


COMPARED = 16  # drives with a table of one system, to see its error


@dataclass(frozen=True)
class TrialEffort:
    """Effort of the samples of trials.

    systems: effective draws of stiffnesses, clearances and the wave, at least and at most; batch, of them at a time;
    draws of them at most; table, of each; effective: samples that have to explain the trials.
    """

    systems: int = 32
    most_systems: int = 128
    batch: int = 16
    most_draws: int = 2048
    table: TableEffort = field(default_factory=TableEffort)
    effective: int = 64

    @classmethod
    def of(cls, systems: int) -> TrialEffort:
        """The effort for so many effective systems, at most four times as many."""
        return cls(systems, 4 * systems, min(16, systems), 64 * systems)

    @property
    def of_one_system(self) -> TrialEffort:
        """As many samples where only deviations are unknown, from finer tables."""
        table = TableEffort(self.systems * self.table.deviations, Mesh(), min(COMPARED, self.systems))
        return replace(self, systems=1, most_systems=8, batch=1, table=table)


TRIAL_EFFORT = TrialEffort()


@dataclass(frozen=True, eq=False)
class Prior:
    """Samples of a drive, and their F'_ior [arcsec] with what stands turned in steps, on a rig.

    F_ior_by_torque [arcsec] by M_g [N*m], and weight, which sums to 1, of shape (samples, directions) each;
    read_error, relative standard deviation of it, by M_g; values of the offset that stands with the wheel by field,
    shape (samples, directions); seed.
    """

    drive: Drive
    rig: Rig
    F_ior_by_torque: Mapping[float, Array]
    weight: Array
    values: Mapping[str, Array]
    read_error: Mapping[float, float]
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
        every = np.arange(self.weight.size) if places is None else places
        return turned_errors(self.F_ior_by_torque[self.M_g if M_g is None else M_g], rotations_deg, every)

    def offset(self, places: Places) -> tuple[Array, Array]:
        """Size [um] and direction [deg] of the offset that stands with the fixed wheel, shape (places,) each."""
        size, direction = (self.values[path].ravel()[places] for path in standing_offset(self.drive))
        return size, direction

    def noise(self, trials: Sequence[Trial]) -> Array:
        """Standard deviations of measured values as stated [arcsec], shape (trials,): their own, or that of all."""
        own = [self.rig.noise_arcsec if each.noise_arcsec is None else each.noise_arcsec for each in trials]
        return np.array(own, dtype=float)


def trial_states(drive: Drive, torques: int, effort: TrialEffort = TRIAL_EFFORT) -> int:
    """Number of states that the samples of trials solve, about, for a progress bar."""
    return effort.systems * torques * (effort.table.mesh.states(drive) + DRAWN_STATES)


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
    prior = open_prior(drive)
    systems = replace(prior, fields=tuple(each for each in prior.fields if each not in open_deviations(prior)))
    if not systems.fields:
        effort = effort.of_one_system
    every = tuple(dict.fromkeys((rig.M_g, *torques, *(each.M_g for each in measured_errors(drive)))))
    solve = partial(_tabled, prior, every, effort.table, run.seed)
    tables: list[TabledErrors | None] = []
    count = effort.systems
    while True:
        samples = draw_samples(
            systems, (), evidence=tuple(each for each in evidence_of(drive) if not each.M_g),
            effort=SamplingEffort(count, count, effort.most_draws, effort.batch), run=run,
        )  # fmt: skip
        numbers = range(len(tables), len(samples.weights))
        for found in run.map(solve, numbers, samples.values()[numbers.start :]):
            tables.append(found)
            run.solved(found.certificate.states if found else 0)
        known = _collected(prior, rig, every, samples, tables)
        if count >= effort.most_systems or enough(known):
            return known
        count = min(count + effort.batch, effort.most_systems)


def _tabled(
    prior: DrivePrior,
    torques: tuple[float, ...],
    effort: TableEffort,
    seed: int,
    number: int,
    values: Mapping[str, float],
) -> TabledErrors | None:
    """F'_ior of a system by its number, with values of its fields, and many deviations; None where it has none."""
    try:
        return tabled_errors(error_maps(prior.drive.with_values(values), torques), prior, effort, [seed, number])
    except HdassistError:
        return None


def _collected(
    belief: DrivePrior, rig: Rig, torques: tuple[float, ...], systems: Samples, tables: Sequence[TabledErrors | None]
) -> Prior:
    """Samples of all systems that are drives, F'_ior by tables corrected for their mean error."""
    drive, kept = belief.drive, [each for each in tables if each]
    if not kept:
        raise UntrustedError("no draw has an answer at the torque of the trials", "hdassist check says why")
    weights = [weight for weight, each in zip(systems.weights, tables, strict=True) if each]
    log_missed = np.concatenate([each.log_missed for each in kept], axis=1)
    F_ior = np.concatenate([each.F_ior_arcsec for each in kept], axis=1)
    weight = np.repeat(weights, len(kept[0].shares))[:, None] * np.ones(F_ior.shape[1:])
    for each in evidence_of(drive):
        if each.figure == ACCURACY:  # without load, where F'_ior is greatest: that of the trials keeps it too
            weight *= np.exp(each.log_likelihood(F_ior[0]))
    if not any_direction(belief):
        weight[:, 1:] = 0
    F_ior *= np.exp(log_missed.mean(axis=1))[:, None, None]
    values = {path: np.concatenate([each.values[path] for each in kept]) for path in standing_offset(drive)}
    proof = sum((each.certificate for each in kept), systems.certificate)
    prior = Prior(
        drive, rig, dict(zip(torques, F_ior, strict=True)), weight / weight.sum(), values,
        dict(zip(torques, log_missed.std(axis=1).tolist(), strict=True)), systems.seed, proof,
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


def open_prior(drive: Drive) -> DrivePrior:
    """The prior of a drive, as `check` has it, with the offset that stands with the fixed wheel open.

    That offset is anywhere up to WIDEST times the preset's, in any direction, unless the preset gives an uncertainty
    for it or does not know it; so is the one that turns with the cam. Raises UsageError where no distribution is
    known of the size of the standing offset.
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
