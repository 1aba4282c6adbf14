"""Pairs of drives from the samples of two drives: alike in all that both presets leave open in the same way.

The second drive of a pair has the values of the first one's sample, but for fields that differ, and draws of its own
for what it leaves open otherwise. Each drive's samples keep their weights: as far as a pair weighs more by the evidence
on the one drive than by that on the other, that drive is paired with all of the other's.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from hdassist.belief.evidence import evidence_of, log_likelihood
from hdassist.belief.prior import DrivePrior, prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import effective_number, even_rows, probability_of
from hdassist.design.check import DesignCheck
from hdassist.error.hills import Indices
from hdassist.errors import UntrustedError
from hdassist.model.geometry import Array
from hdassist.preset.fields import Drive
from hdassist.preset.kinds import UNKNOWN
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY, Certificate
from hdassist.verdict import SURE

DRAWN_PAIRS = 64
LEAST_EFFECTIVE = 0.5  # of the pairs: where fewer agree with the evidence on the second drive, samples are independent
LEAST_WEIGHT = 1e-300  # where a sample has none it is not divided by
SAME_ERROR = 0.005  # arcsec: a change that is less counts as none


@dataclass(frozen=True, eq=False)
class DrivePairs:
    """Pairs of a first and a second drive.

    F'_ior of samples of each [arcsec], shape (samples, torques); weights of each sample of the first with each of the
    second, shape (samples, samples of the second); drives: some pairs that weigh alike, with all that is drawn;
    sampled: places of the drives that are drawn, not known.
    """

    before_arcsec: Array
    after_arcsec: Array
    weights: Array
    drives: tuple[tuple[Drive, Drive], ...]
    sampled: tuple[int, ...] = (0, 1)
    certificate: Certificate = EMPTY

    def senses(self) -> tuple[str, ...]:
        """Whether F'_ior is less, more or the same in the second drive, by torque; unknown where that is not sure."""
        change = self.after_arcsec - self.before_arcsec[:, None]  # (samples, samples of the second, torques)
        return tuple(self._sense(change[..., k]) for k in range(change.shape[-1]))

    def _sense(self, change: Array) -> str:
        if np.all(np.abs(change[self.weights > 0]) < SAME_ERROR):
            return "the same"
        for sense, inside in (("less", change < 0), ("more", change > 0)):
            # once over the samples of each drive: of so many that chance alone could make it otherwise
            marginals = [(self.weights.sum(1 - k), (self.weights * inside).sum(1 - k)) for k in self.sampled]
            found = [probability_of(hits / np.maximum(of, LEAST_WEIGHT), of) for of, hits in marginals]
            if all(each.low >= SURE for each in found) and inside.any():
                return sense
        return UNKNOWN


@dataclass(frozen=True, eq=False, kw_only=True)
class PairedPrior(DrivePrior):
    """The prior of a drive that is drawn beside samples of another one, as shares, shape (pairs, fields + 1)."""

    paired: Array

    def shares(self, count: int, seed: int = 0) -> Array:  # noqa: ARG002 - the samples have theirs
        """The first of the pairs, whatever the seed."""
        return self.paired[:count]


def differently_open(first: Drive, second: Drive) -> list[str]:
    """Paths of fields that one of two drives leaves open, and the other does not in the same way.

    The same way is with the same distribution, or unknown in both, however large they may be.
    """

    def open_fields(drive: Drive) -> dict[str, object]:
        fields = prior_of(drive).fields
        return {f.path: drive.value(f.path) is not None and (f.distribution, f.low, f.high, f.draws) for f in fields}

    one, other = open_fields(first), open_fields(second)
    return [path for path in one | other if one.get(path) != other.get(path)]


class _Believed:
    """What is not known of a checked drive, its samples, and F'_ior of these or of the drive itself."""

    def __init__(self, check: DesignCheck) -> None:
        self.drive, self.prior, self.evidence = check.drive, prior_of(check.drive), evidence_of(check.drive)
        self.samples = check.samples.of_ranges if check.samples else None
        known = np.array([[point.F_ior_or_error for point in check.points]])
        self.F_ior_arcsec = self.samples.F_ior_arcsec if self.samples else known  # (samples, torques)
        self.weights: Array = self.samples.weights / self.samples.weights.sum() if self.samples else np.ones(1)

    def drives(self, rows: Indices) -> list[Drive]:
        """Drives of some samples; the drive itself where nothing was drawn."""
        values = self.samples.values(rows) if self.samples else [{}] * len(rows)
        return list(map(self.drive.with_values, values))


def drawn_pairs(
    first: DesignCheck, second: DesignCheck, *, same: bool, count: int = DRAWN_PAIRS, run: Run = Run()
) -> DrivePairs:
    """Pairs of the samples of two checked drives.

    Samples are independent of each other where a drive has none, where F'_ior as measured is evidence, where the first
    has evidence that the second has not, or where few pairs agree with that on the second. Arguments: same, whether
    nothing that moves F'_ior differs; count, pairs that are drawn. Raises UntrustedError where an answer cannot be
    trusted.
    """
    one, other = _Believed(first), _Believed(second)
    rows, others = (even_rows(each.weights, count if one.samples or other.samples else 1) for each in (one, other))
    drives = tuple(zip(one.drives(rows), other.drives(others), strict=True))
    if same:
        return DrivePairs(one.F_ior_arcsec, one.F_ior_arcsec, np.diag(one.weights), drives)
    measured = any(each.M_g for each in other.evidence)
    if one.samples and other.samples and not measured and {*one.evidence} <= {*other.evidence}:
        with suppress(UntrustedError):
            return _paired(one, other, rows, run)
    sampled = tuple(k for k, each in enumerate((one, other)) if each.samples)
    return DrivePairs(one.F_ior_arcsec, other.F_ior_arcsec, np.outer(one.weights, other.weights), drives, sampled)


def _paired(one: _Believed, other: _Believed, rows: Indices, run: Run) -> DrivePairs:
    """Pairs of some samples of a first drive, each with a drive alike. Raises UntrustedError where too few agree."""
    assert one.samples and other.samples
    shares, count = one.samples.shares[rows], len(rows)
    paths, apart = [each.path for each in one.prior.fields], differently_open(one.drive, other.drive)
    paired = other.prior.joined(np.random.default_rng(run.seed).random((count, len(other.prior.fields) + 1)))
    for k, field in enumerate(other.prior.fields):
        if field.path not in apart:
            paired[:, k] = shares[:, paths.index(field.path)]
    paired[:, -1] = 0  # each goes on to F'_ior
    found, proof = other.samples, EMPTY
    if one.evidence or other.evidence or not np.array_equal(paired[:, :-1], found.shares):
        prior = PairedPrior(other.drive, other.prior.fields, paired=paired)
        found = draw_samples(
            prior, found.torques, evidence=other.evidence, further=_no_figures, enough=lambda _: False,
            effort=SamplingEffort(effective=1, most_draws=count), run=run,
        )  # fmt: skip
        proof = found.certificate
    solved = np.flatnonzero([each.F_ior_arcsec is not None for each in found.made])
    figures = [[each.figures for each in of.made if each.F_ior_arcsec is not None] for of in (one.samples, found)]
    gain = [
        log_likelihood(other.evidence, now) - log_likelihood(one.evidence, figures[0][row])
        for row, now in zip(rows[solved], figures[1], strict=True)
    ]
    weights = np.exp(np.array(gain) - max(gain))
    if effective_number(weights) < LEAST_EFFECTIVE * count:
        raise UntrustedError("too few pairs agree with the evidence on both drives")
    of_one, of_other = np.full(count, 1 / count), np.zeros(count)
    of_other[solved] = weights / weights.sum()
    alike = np.minimum(of_one, of_other)
    joint, left = np.diag(alike), 1 - alike.sum()
    if left > 0:
        joint += np.outer(of_one - alike, of_other - alike) / left
    chosen = solved[even_rows(weights, count)]
    others = map(other.drive.with_values, found.values(even_rows(weights, count)))
    drives = zip(one.drives(rows[chosen]), others, strict=True)
    before = one.F_ior_arcsec[rows]
    return DrivePairs(before, found.F_ior_arcsec, joint[:, solved], tuple(drives), certificate=proof)


def _no_figures(_drive: Drive) -> tuple[dict[str, float], Certificate]:
    """None beside F'_ior, and by that draws that are not kept: they are not those of the drive alone."""
    return {}, EMPTY
