"""Comparison of drives with the first of them: sheets, differing fields, and the change of F'_ior by each field.

Changes are those of pairs from the samples of two drives. The samples of a pair are equal in all fields that both
presets leave uncertain in the same way. The second drive of a pair has the values of the first drive's sample, except
for differing fields and for its own samples of fields that are uncertain in another way. The samples of each drive keep
their weights. If the reference data of one drive give a pair a larger weight than those of the other drive, the excess
weight is distributed over pairs with all samples of the other drive.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, partial
from operator import attrgetter
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hdassist.belief.evidence import evidence_of, log_likelihood
from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.belief.samples import EFFECTIVE_SAMPLES, Samples, SamplingEffort, draw_samples
from hdassist.belief.statistics import (
    RESOLVED_ERROR,
    Probability,
    effective_number,
    even_rows,
    probability_of,
    weighted_quantile,
)
from hdassist.drive.error.error_map import Batch, Indices, error_maps, searchable
from hdassist.drive.error.extremes import DRAWN_GRIDS, DRAWN_STATES, extremes_of, many_extremes
from hdassist.drive.error.stiffness import Stiffness, stiffness, stiffness_states
from hdassist.drive.model.deviations import unknowns
from hdassist.drive.model.geometry import Array
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.fields import UNKNOWN, Drive, ResolvedField, resolved_fields
from hdassist.drive.solve.answers import EMPTY, Certificate
from hdassist.drive.solve.loadcase import CrossCheck
from hdassist.features.design import DesignCheck, check, check_states
from hdassist.features.mounting.advice import Advice, advice_states, advise
from hdassist.features.mounting.positions import seat_positions
from hdassist.run.errors import HdassistError, UntrustedError, Verdict
from hdassist.run.run import Run

_DRAWN_PAIRS = 64  # number of sampled pairs
# smallest effective share of the pairs that agree with the second drive's reference data; with fewer, samples are
# independent
_LEAST_EFFECTIVE = 0.5
_LEAST_WEIGHT = 1e-300  # prevents division by a weight of 0
_SAME_ERROR = 0.005  # arcsec; a smaller change counts as none
_LIKELIER = 0.6  # smallest probability of being better at which a drive is recommended
_EQUAL_SHARE = 0.01  # largest difference in F'_ior between equally good drives, as a share
# number of pairs in which single fields are changed; the first pairs are used, because Sobol points are even from the
# start
_SINGLE_PAIRS = 16
# number of these pairs with which every field is tried, before the most effective fields are changed in all pairs
_SCREENED_PAIRS = 2
_REPORTED_FIELDS = 3
# fields without effect on F'_ior at a torque: loads, reference data, limits, holes of the seat, resolution of other
# results, and uncertainties
_UNRELATED = (
    "operation.M_g",
    "operation.rated",
    "catalogue.",
    "measured.",
    "acceptance.",
    "mounting.holes",
    "mounting.first_hole",
    "mounting.allowed",
    "numerics.n_phase",
    "uncertainty.",
)
_FieldRow = tuple[ResolvedField, ...]  # one field, for each drive


@dataclass(frozen=True, eq=False)
class DriveSheet:
    """Check of a drive, recommended hole of its wheel, and its stiffness."""

    check: DesignCheck
    advice: Advice
    stiffness: Stiffness

    @property
    def drive(self) -> Drive:
        """The checked drive."""
        return self.check.drive

    def probabilities_met(self, torque: int) -> tuple[Probability, Probability] | None:
        """Return the probabilities of meeting the limit as assembled and in the best hole, with their intervals.

        The result is None without a limit. Without uncertain inputs, the probabilities are 0 or 1.

        torque: index of the torque.
        """
        point = self.check.points[torque]
        room = point.left_arcsec
        hole = self.advice.chosen
        if room is None or (point.probability is None and point.F_ior_arcsec is None):
            return None
        # without uncertain inputs, the probabilities are 0 or 1
        if point.probability is None:
            is_met = point.F_ior_or_error <= room
            is_met_in_hole = hole.F_ior_arcsec[torque] <= room
            return Probability.certain(is_met), Probability.certain(is_met_in_hole)
        as_assembled = point.probability
        samples = self.advice.samples
        # the best hole is the present hole, or no better than it
        if samples is None or self.advice.decision.all_alike or not hole.rotation_deg % 360:
            return as_assembled, as_assembled
        column = samples.rotations_deg.index(hole.rotation_deg)
        in_hole = samples.probability(lambda stage: stage.turned_arcsec[:, torque, column] <= room, point.sure)
        return as_assembled, in_hole

    @property
    def certificate(self) -> Certificate:
        """Certificate of check, mounting and stiffness together."""
        return self.check.certificate + self.advice.certificate + self.stiffness.certificate

    @property
    def cross_checks(self) -> tuple[CrossCheck | None, ...]:
        """Cross-checks of check, mounting and stiffness."""
        return (*self.check.cross_checks, *self.advice.cross_checks, self.stiffness.cross_check)


def sheet_states(drive: Drive, draws: int = EFFECTIVE_SAMPLES) -> int:
    """Return the approximate number of states solved for a sheet, for the progress bar."""
    mounting = advice_states(
        drive,
        len(seat_positions(drive)),
        draws=draws,
    )
    return check_states(drive, draws=draws) + mounting + stiffness_states()


def sheet_of(
    drive: Drive,
    *,
    draws: int = EFFECTIVE_SAMPLES,
    run: Run = Run(),
) -> DriveSheet:
    """Check a drive, determine its best hole and compute its stiffness, as the corresponding commands do.

    drive: the drive.
    draws: effective sample size of the uncertain inputs.
    Raises UntrustedError if a result cannot be trusted.
    """
    # the advice comes first: its samples also contain F'_ior with the fixed wheel turned, and the check uses them again
    advice = advise(
        drive,
        seat_positions(drive),
        draws=draws,
        run=run,
    )
    checked = check(
        drive,
        draws=draws,
        samples=advice.samples,
        run=run,
    )
    return DriveSheet(checked, advice, stiffness(drive, run=run))


@dataclass(frozen=True, eq=False)
class DrivePairs:
    """Pairs of a first and a second drive.

    before_arcsec, after_arcsec: F'_ior of the samples of the first and the second drive [arcsec], shape (samples,
        torques).
    weights: weight of each pair, shape (samples of the first drive, samples of the second).
    drives: some equally weighted pairs, with all sampled fields.
    sampled: indices of the drives (0, 1) that are sampled.
    certificate: certificate of the solved states.
    """

    before_arcsec: Array
    after_arcsec: Array
    weights: Array
    drives: tuple[tuple[Drive, Drive], ...]
    sampled: tuple[int, ...] = (0, 1)
    certificate: Certificate = EMPTY

    def senses(self) -> tuple[str, ...]:
        """Return at each torque whether F'_ior of the second drive is less, more, the same or unknown."""
        return tuple(map(self._sense, self._changes()))

    def probabilities_less(self) -> tuple[Probability, ...]:
        """Return the probability at each torque that F'_ior of the second drive is smaller."""
        return tuple(self._probability(change < -_SAME_ERROR) for change in self._changes())

    def _changes(self) -> Array:
        """Return the changes of F'_ior [arcsec], shape (torques, samples, samples of the second drive)."""
        return np.asarray(self.after_arcsec.T[:, None, :] - self.before_arcsec.T[:, :, None])

    def _sense(self, change: Array) -> str:
        if np.all(np.abs(change[self.weights > 0]) < _SAME_ERROR):
            return "the same"
        # only a clear majority of the pairs determines the sense
        for sense, inside in (("less", change < 0), ("more", change > 0)):
            if inside.any() and self._probability(inside).verdict() is Verdict.PASS:
                return sense
        return UNKNOWN

    def _probability(self, inside: NDArray[np.bool_]) -> Probability:
        """Return the probability of a change, with an interval that contains the intervals from both sampled drives.

        inside: whether each pair has the change, shape (samples, samples of the second drive).
        """
        # pairs share samples, so the number of pairs would give too narrow an interval
        marginals = ((self.weights.sum(1 - k), (self.weights * inside).sum(1 - k)) for k in self.sampled)
        probabilities = [
            probability_of(hits / np.maximum(group_weight, _LEAST_WEIGHT), group_weight)
            for group_weight, hits in marginals
        ]
        value = float(np.average(inside, weights=self.weights))
        low = min((p.low for p in probabilities), default=value)
        high = max((p.high for p in probabilities), default=value)
        return Probability(value, low, high, few=True)


@dataclass(frozen=True, eq=False, kw_only=True)
class _PairedPrior(DrivePrior):
    """Prior of a drive that is sampled together with samples of another drive.

    paired: shares of the fields, shape (pairs, fields + 1).
    """

    paired: Array

    def shares(self, count: int, seed: int = 0) -> Array:  # noqa: ARG002 - the given shares need no seed
        """Return the shares of the first pairs, shape (count, fields + 1), independently of the seed."""
        return self.paired[:count]


def differently_open(first: Drive, second: Drive) -> list[str]:
    """Return the paths of fields that are uncertain in one of two drives, and not in the same way in the other.

    Fields with the same distribution, or unknown in both drives, are uncertain in the same way.
    """

    def open_fields(drive: Drive) -> dict[str, object]:
        fields = prior_of(drive).fields
        return {f.path: drive.value(f.path) is not None and (f.distribution, f.low, f.high, f.draws) for f in fields}

    one = open_fields(first)
    other_fields = open_fields(second)
    return [path for path in one | other_fields if one.get(path) != other_fields.get(path)]


class _Believed:
    """Uncertain inputs of a checked drive, its samples, and F'_ior of the samples or of the drive itself."""

    def __init__(self, check: DesignCheck) -> None:
        self.drive = check.drive
        self.prior = prior_of(check.drive)
        self.evidence = evidence_of(check.drive)
        self.samples = check.samples.of_ranges if check.samples else None
        F_ior_known = np.array([[point.F_ior_or_error for point in check.points]])
        self.F_ior_arcsec = self.samples.F_ior_arcsec if self.samples else F_ior_known  # shape (samples, torques)
        self.weights: Array = self.samples.weights / self.samples.weights.sum() if self.samples else np.ones(1)

    def drives(self, rows: Indices) -> list[Drive]:
        """Return the drives of selected samples; the drive itself without samples."""
        values = self.samples.values(rows) if self.samples else [{} for _ in rows]
        return list(map(self.drive.with_values, values))


def drawn_pairs(
    first: DesignCheck,
    second: DesignCheck,
    *,
    same: bool,
    count: int = _DRAWN_PAIRS,
    run: Run = Run(),
) -> DrivePairs:
    """Return the pairs of the samples of two checked drives.

    Samples are independent in four cases: a drive has no samples, measured F'_ior is reference data, the first drive
    has reference data that the second does not have, or too few pairs agree with those of the second drive.

    same: whether no field with an effect on F'_ior differs.
    count: number of sampled pairs.
    Raises UntrustedError if a result cannot be trusted.
    """
    one = _Believed(first)
    second_belief = _Believed(second)
    rows, second_rows = (
        even_rows(side.weights, count if one.samples or second_belief.samples else 1) for side in (one, second_belief)
    )
    drives = tuple(
        zip(
            one.drives(rows),
            second_belief.drives(second_rows),
            strict=True,
        )
    )
    if same:
        return DrivePairs(
            before_arcsec=one.F_ior_arcsec, after_arcsec=one.F_ior_arcsec, weights=np.diag(one.weights), drives=drives
        )
    measured = any(figure.M_g for figure in second_belief.evidence)
    if one.samples and second_belief.samples and not measured and {*one.evidence} <= {*second_belief.evidence}:
        with suppress(UntrustedError):
            return _paired(one, second_belief, rows, run)
    sampled = tuple(k for k, side in enumerate((one, second_belief)) if side.samples)
    return DrivePairs(
        before_arcsec=one.F_ior_arcsec,
        after_arcsec=second_belief.F_ior_arcsec,
        weights=np.outer(one.weights, second_belief.weights),
        drives=drives,
        sampled=sampled,
    )


def _likelihood_gains(
    one: _Believed,
    other: _Believed,
    rows: Indices,
    samples: Samples,
) -> list[float]:
    """Return the log likelihood of the second drive of each pair minus that of the first drive.

    The likelihood of each drive is that of its own reference data.

    one: the first drive.
    other: the second drive.
    rows: indices of samples of the first drive, shape (pairs,).
    samples: samples of the second drive, one per row.
    """
    assert one.samples
    figures_of_one = _figures_of(one.samples)
    gains = []
    for row, figures in zip(rows, _figures_of(samples), strict=True):
        of_one = log_likelihood(one.evidence, figures_of_one[row])
        gains.append(log_likelihood(other.evidence, figures) - of_one)
    return gains


def _paired(
    one: _Believed,
    other: _Believed,
    rows: Indices,
    run: Run,
) -> DrivePairs:
    """Return pairs of selected samples of a first drive with samples of a second drive that share their inputs.

    one: the first drive.
    other: the second drive.
    rows: indices of the selected samples of the first drive, shape (pairs,).
    run: the run.
    Raises UntrustedError if too few pairs agree with the reference data.
    """
    assert one.samples and other.samples
    count = len(rows)
    shares = _paired_shares(one, other, rows, run)
    # samples of the second drive are reused if they have these shares and no reference data
    samples = other.samples
    certificate = EMPTY
    if one.evidence or other.evidence or not np.array_equal(shares[:, :-1], samples.shares):
        samples = _samples_with(other, shares, run)
        certificate = samples.certificate
    solved = np.flatnonzero([draw.F_ior_arcsec is not None for draw in samples.made])
    gains = _likelihood_gains(one, other, rows[solved], samples)
    # importance weights replace the reference data of the first drive by those of the second
    weights = np.exp(np.array(gains) - max(gains))
    if effective_number(weights) < _LEAST_EFFECTIVE * count:
        message = "too few pairs of samples agree with the reference data of both drives"
        raise UntrustedError(message, "check the reference data of both presets")
    # as many pairs as samples are selected by their weights
    even = even_rows(weights, count)
    second_drives = map(other.drive.with_values, samples.values(even))
    return DrivePairs(
        before_arcsec=one.F_ior_arcsec[rows],
        after_arcsec=samples.F_ior_arcsec,
        weights=_joint_weights(count, solved, weights)[:, solved],
        drives=tuple(
            zip(
                one.drives(rows[solved[even]]),
                second_drives,
                strict=True,
            )
        ),
        certificate=certificate,
    )


def _figures_of(samples: Samples) -> list[Mapping[str, float]]:
    """Return the figures of the samples that have an error."""
    return [draw.figures for draw in samples.made if draw.F_ior_arcsec is not None]


def _samples_with(
    believed: _Believed,
    shares: Array,
    run: Run,
) -> Samples:
    """Return samples of a drive in a single batch, from given shares of its fields, shape (samples, fields + 1)."""
    assert believed.samples
    return draw_samples(
        _PairedPrior(believed.drive, believed.prior.fields, paired=shares),
        believed.samples.torques,
        evidence=believed.evidence,
        figures_of=_no_figures,
        enough=lambda _: False,
        effort=SamplingEffort(1, len(shares), len(shares)),
        run=run,
    )


def _paired_shares(
    one: _Believed,
    other: _Believed,
    rows: Indices,
    run: Run,
) -> Array:
    """Return shares of the fields of a second drive, shape (rows, fields + 1).

    Fields that are uncertain in the same way in both drives get the shares of the first drive.
    one: the first drive.
    other: the second drive.
    rows: indices of samples of the first drive.
    run: the run, whose seed determines the other shares.
    """
    assert one.samples
    shares = one.samples.shares[rows]
    paths = [field.path for field in one.prior.fields]
    different_paths = differently_open(one.drive, other.drive)
    paired = other.prior.joined(np.random.default_rng(run.seed).random((len(rows), len(other.prior.fields) + 1)))
    for k, field in enumerate(other.prior.fields):
        if field.path not in different_paths:
            paired[:, k] = shares[:, paths.index(field.path)]
    paired[:, -1] = 0  # F'_ior is solved for every pair
    return paired


def _joint_weights(
    count: int,
    solved: Indices,
    weights: Array,
) -> Array:
    """Return the weights of pairs of samples, shape (count, count), with the largest possible weight on the diagonal.

    count: number of samples of each drive.
    solved: indices of samples of the second drive with a result.
    weights: weights of these samples, not normalized.
    """
    of_one = np.full(count, 1 / count)
    of_other = np.zeros(count)
    of_other[solved] = weights / weights.sum()
    common = np.minimum(of_one, of_other)
    joint = np.diag(common)
    remaining = 1 - common.sum()
    if remaining > 0:
        joint += np.outer(of_one - common, of_other - common) / remaining
    return joint


def _no_figures(_drive: Drive) -> tuple[dict[str, float], Certificate]:
    """Return no figures besides F'_ior, to prevent draws of pairs from being cached as those of a single drive."""
    return {}, EMPTY


@dataclass(frozen=True)
class ErrorChange:
    """Change of F'_ior of a drive, at each torque, due to one field or to all fields together.

    field: path of the field; empty for all fields.
    change_arcsec: median of the change over the sampled pairs [arcsec].
    p5_arcsec, p95_arcsec: 5th and 95th percentiles of the change [arcsec].
    share: size of the median change relative to the median of F'_ior before.
    """

    field: str
    change_arcsec: tuple[float, ...]
    p5_arcsec: tuple[float, ...]
    p95_arcsec: tuple[float, ...]
    share: tuple[float, ...]

    @classmethod
    def of(
        cls,
        field: str,
        before: Array,
        after: Array,
        weights: Array,
    ) -> ErrorChange:
        """Return the change from F'_ior before to after, shape (pairs, torques) [arcsec]; weights: shape (pairs,)."""

        def percentile(values: Array, share: float) -> tuple[float, ...]:
            return tuple(weighted_quantile(column, weights, share) for column in values.T)

        low, median, high = (percentile(after - before, share) for share in (0.05, 0.5, 0.95))
        shares = np.abs(median) / np.maximum(percentile(before, 0.5), RESOLVED_ERROR)
        return cls(field, median, low, high, tuple(shares.tolist()))


@dataclass(frozen=True)
class DriveChanges:
    """Changes of F'_ior from a first drive to a second one.

    pairs: number of sampled pairs, which are equal in fields that both drives leave uncertain in the same way.
    F_ior_is: less, more or the same at each torque; unknown if uncertain inputs could reverse the sense.
    probability_better: probability that F'_ior is smaller, by torque; None if uncertain inputs were not sampled.
    together: change due to all fields.
    single: changes due to single fields, the largest first.
    not_alone: paths of fields without a single change, because most drives with this change alone have a conflict, more
        unknown inputs or no result.
    """

    pairs: int
    F_ior_is: tuple[str, ...]
    probability_better: tuple[Probability | None, ...]
    together: ErrorChange
    single: tuple[ErrorChange, ...]
    not_alone: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DrivesComparison:
    """Comparison of drives with the first of them.

    sheets: sheets of the drives, all at the same torques or at the same shares of their rated torques.
    differing: fields in which the drives differ.
    changes: changes from the first drive to each of the others.
    certificate: certificate of all states.
    """

    sheets: tuple[DriveSheet, ...]
    differing: tuple[_FieldRow, ...]
    changes: tuple[DriveChanges, ...]
    certificate: Certificate

    @property
    def torques(self) -> tuple[float, ...]:
        """Torques of the first drive [N*m]."""
        return self.sheets[0].drive.operation.M_g

    @property
    def rated_shares(self) -> tuple[float, ...] | None:
        """Shares of the rated torque at which all drives are compared; None if their torques are the same."""
        if all(sheet.drive.operation.M_g == self.torques for sheet in self.sheets):
            return None
        return tuple(M_g / self.sheets[0].drive.rated_torque for M_g in self.torques)

    @cached_property
    def shares(self) -> Array:
        """Median of F'_ior relative to that of the first drive, shape (drives, torques)."""
        medians = np.array([[point.F_ior_or_error for point in sheet.check.points] for sheet in self.sheets])
        return np.asarray(medians / np.maximum(medians[0], RESOLVED_ERROR))

    @property
    def best(self) -> int:
        """Index of the drive whose largest share over the torques is smallest; 0 if no drive improves on the first."""
        worst = self.shares.max(axis=1)
        return int(worst.argmin()) if worst.min() < 1 - _EQUAL_SHARE else 0

    @property
    def word(self) -> Literal["TAKE", "KEEP", "ANY"]:
        """Recommendation: TAKE another drive, KEEP the first one, or ANY drive if none is clearly better."""
        chance = self.probability_best
        if self.all_alike or (chance is not None and chance.value < _LIKELIER):
            return "ANY"
        return "TAKE" if self.best else "KEEP"

    @property
    def all_alike(self) -> bool:
        """Whether all drives are within _EQUAL_SHARE of the first."""
        return bool(np.all(np.abs(self.shares - 1) < _EQUAL_SHARE))

    @property
    def probability_best(self) -> Probability | None:
        """Probability that F'_ior of the best drive is smaller than that of the first, at the least favourable torque.

        If the first drive is the best, it is the probability that no other drive is better there. It is None if
        uncertain inputs were not sampled.
        """
        chances = []
        for changes in [self.changes[self.best - 1]] if self.best else self.changes:
            known_chances = [chance for chance in changes.probability_better if chance is not None]
            if len(known_chances) < len(changes.probability_better):
                return None
            chances.append(min(known_chances, key=attrgetter("value")))
        return chances[0] if self.best else max(chances, key=attrgetter("value")).complement


def at_common_torques(drives: Sequence[Drive]) -> list[Drive]:
    """Return the drives at the torques that all of them have, in the sequence of the first drive.

    Without common torques, each drive gets the torques that are the same shares of its rated torque as in the first
    drive.
    """
    first = drives[0]
    common = tuple(M_g for M_g in first.operation.M_g if all(M_g in drive.operation.M_g for drive in drives))
    shares = [M_g / first.rated_torque for M_g in first.operation.M_g]

    def torques(drive: Drive) -> tuple[float, ...]:
        return common or tuple(float(f"{share * drive.rated_torque:.6g}") for share in shares)

    return [drive.with_values({"operation.M_g": torques(drive)}) for drive in drives]


def differing_rows(drives: Sequence[Drive]) -> tuple[_FieldRow, ...]:
    """Return the fields in which drives differ, in the order of their declarations, followed by uncertainties."""
    rows = list(zip(*map(resolved_fields, drives), strict=True))
    units = {row[0].path: row[0].unit for row in rows}
    for path in dict.fromkeys(path for drive in drives for path in drive.uncertainty):
        field = partial(
            ResolvedField,
            f"uncertainty.{path}",
            unit=units[path],
            ref="",
            meaning="",
            range=None,
        )
        values = (drive.uncertainty.get(path) for drive in drives)
        rows.append(tuple(field(value=value, kind="default" if value is None else "given") for value in values))
    open_ = {path for drive in drives[1:] for path in differently_open(drives[0], drive)}
    return tuple(row for row in rows if row[0].path in open_ or any(cell.value != row[0].value for cell in row))


def differing_fields(drives: Sequence[Drive]) -> list[str]:
    """Return the paths of the fields that differ between drives and may affect F'_ior at a torque."""
    return [row[0].path for row in differing_rows(drives) if not row[0].path.startswith(_UNRELATED)]


def estimate_comparison(drives: Sequence[Drive], draws: int = EFFECTIVE_SAMPLES) -> int:
    """Return the approximate number of states solved for a comparison, for the progress bar."""
    searches = sum(_DRAWN_PAIRS + _SCREENED_PAIRS * len(differing_fields((drives[0], drive))) for drive in drives[1:])
    return sum(sheet_states(drive, draws) for drive in drives) + DRAWN_STATES * len(drives[0].operation.M_g) * searches


def compare_drives(
    drives: Sequence[Drive],
    *,
    draws: int = EFFECTIVE_SAMPLES,
    run: Run = Run(),
) -> DrivesComparison:
    """Compare two or more drives with the first of them, at torques from `at_common_torques`.

    draws: effective sample size of the uncertain inputs of each drive.
    Raises UntrustedError if a result cannot be trusted, and KeyboardInterrupt if the command is interrupted.
    """
    sheets = tuple(sheet_of(drive, draws=draws, run=run) for drive in drives)
    first, *other_checks = (sheet.check for sheet in sheets)
    answers = [drive_changes(first, check, pairs=min(draws, _DRAWN_PAIRS), run=run) for check in other_checks]
    changes, proofs = zip(*answers, strict=True)
    proof = sum(proofs, sum((sheet.certificate for sheet in sheets), EMPTY))
    return DrivesComparison(
        sheets=sheets,
        differing=differing_rows(drives),
        changes=changes,
        certificate=proof,
    )


def _is_undrawn(first: DesignCheck, second: DesignCheck) -> bool:
    """Return whether F'_ior of one of two drives has no distribution at some torque."""
    return any(point.F_ior_arcsec is None for point in (*first.points, *second.points))


def drive_changes(
    first: DesignCheck,
    second: DesignCheck,
    *,
    pairs: int = _DRAWN_PAIRS,
    run: Run = Run(),
) -> tuple[DriveChanges, Certificate]:
    """Compute the changes of F'_ior from a first drive to a second one, due to all fields and to single fields.

    All fields are changed together with the torques, single fields at the torques of the first drive.

    first: check of the first drive.
    second: check of the second drive.
    pairs: number of pairs of their samples.
    run: processes, progress and seed.
    Raises UntrustedError if one of the drives has no result that can be trusted.
    """
    # fields whose values differ; other fields may differ in their samples
    differing = differing_fields((first.drive, second.drive))
    is_same = not differing and _has_same_conditions(first.drive, second.drive)
    sampled_pairs = drawn_pairs(
        first,
        second,
        same=is_same,
        count=pairs,
        run=run,
    )
    single_changes = _SingleChanges.of(sampled_pairs, first, second, run)
    # the bounds of unknown fields may depend on other fields
    open_paths = [field.path for field in prior_of(second.drive).fields]
    moved = [path for path in open_paths if single_changes.is_moved(path)]
    paths = dict.fromkeys((*differing, *moved))
    # many fields are tried on a few pairs, then those with the largest changes on all pairs
    screened = [change.field for change in single_changes.largest_first(paths, _SCREENED_PAIRS)]
    single = single_changes.largest_first(screened[:_REPORTED_FIELDS], len(single_changes.drives))
    is_unknown = _is_undrawn(first, second) and not is_same
    changes = DriveChanges(
        pairs=len(sampled_pairs.drives),
        F_ior_is=tuple(UNKNOWN for _ in first.points) if is_unknown else sampled_pairs.senses(),
        probability_better=tuple(None for _ in first.points) if is_unknown else sampled_pairs.probabilities_less(),
        together=_joint_change(sampled_pairs),
        single=tuple(single),
        not_alone=tuple(path for path in paths if path not in screened),
    )
    return changes, single_changes.certificate


def _has_same_conditions(first: Drive, second: Drive) -> bool:
    """Return whether two drives have the same torques and the same reference data."""
    return first.operation.M_g == second.operation.M_g and evidence_of(first) == evidence_of(second)


def _joint_change(pairs: DrivePairs) -> ErrorChange:
    """Return the change due to all fields together."""
    rows, columns = np.nonzero(pairs.weights)
    return ErrorChange.of("", pairs.before_arcsec[rows], pairs.after_arcsec[columns], pairs.weights[rows, columns])


@dataclass
class _SingleChanges:
    """Changes of F'_ior due to single fields, from first drives to second ones, at the torques of the first."""

    drives: Sequence[tuple[Drive, Drive]]
    torques: Sequence[float]  # torques [N*m]
    is_drawn: bool  # whether the drives are samples
    run: Run
    certificate: Certificate  # certificate of all states, including those of changes once they are solved

    @classmethod
    def of(
        cls,
        pairs: DrivePairs,
        first: DesignCheck,
        second: DesignCheck,
        run: Run,
    ) -> _SingleChanges:
        """Return the changes for the first few pairs of samples of two drives, before any is solved."""
        return cls(
            drives=pairs.drives[:_SINGLE_PAIRS],
            torques=first.drive.operation.M_g,
            is_drawn=bool(first.samples or second.samples),
            run=run,
            certificate=pairs.certificate,
        )

    @cached_property
    def before_arcsec(self) -> Array:
        """F'_ior of the first drives [arcsec], shape (drives, torques)."""
        return self.solve([first for first, _ in self.drives])

    def is_moved(self, path: str) -> bool:
        """Return whether a field differs in any pair."""
        return any(first.value(path) != second.value(path) for first, second in self.drives)

    def solve(self, drives: Sequence[Drive]) -> Array:
        """Return F'_ior of drives [arcsec], shape (drives, torques); NaN without a result."""
        errors_of = partial(
            _errors,
            torques=self.torques,
            drawn=self.is_drawn,
        )
        values = np.empty((len(drives), len(self.torques)))
        for row, (errors, certificate) in zip(values, self.run.map(errors_of, drives), strict=True):
            self.certificate += certificate
            self.run.solved(certificate.states)
            row[:] = errors
        return values

    def change_by(self, path: str, count: int) -> ErrorChange | None:
        """Return the change due to a single field over the first pairs; None if most of them have no result."""
        # sound drives have no conflict, and no more unknown fields than before (for example a direction)
        sound = {}
        for k, (first, second) in enumerate(self.drives[:count]):
            changed = first.with_values({path: second.value(path)})
            if len(unknowns(changed)) <= len(unknowns(first)) and first_conflict(changed) is None:
                sound[k] = changed
        before_arcsec = self.before_arcsec[[*sound]]
        after_arcsec = self.solve([*sound.values()])
        is_solved = ~np.isnan(after_arcsec).any(axis=1)
        if 2 * is_solved.sum() < min(count, len(self.drives)):
            return None
        return ErrorChange.of(path, before_arcsec[is_solved], after_arcsec[is_solved], np.ones(is_solved.sum()))

    def largest_first(self, paths: Iterable[str], count: int) -> list[ErrorChange]:
        """Return the changes due to single fields over the first pairs, the largest first, if they have a result."""
        changes = [self.change_by(path, count) for path in paths]
        return sorted(filter(None, changes), key=lambda change: -max(change.share))


def _errors(
    drive: Drive,
    torques: Sequence[float],
    drawn: bool,
) -> tuple[Array, Certificate]:
    """Return F'_ior of a drive [arcsec], shape (torques,), with its certificate; NaN without a result."""
    try:
        by_torque = (
            [many_extremes(error_map, Batch.of(drive), DRAWN_GRIDS) for error_map in error_maps(drive, torques)]
            if drawn and searchable(drive)
            else extremes_of(drive, torques)
        )
    except HdassistError:
        return np.full(len(torques), np.nan), EMPTY
    return np.array([extremes.first for extremes in by_torque]), sum(
        (extremes.certificate for extremes in by_torque), EMPTY
    )
