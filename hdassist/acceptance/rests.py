"""What predictions rest on, as the files of `hdassist accept` have it: proof, what is assumed, what is not known."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.acceptance.predictions import Predictions
from hdassist.acceptance.request import ClosedRecord
from hdassist.preset.kinds import short
from hdassist.solve.throughcvxpy import CrossCheck


@dataclass(frozen=True)
class ResidualsRecord(ClosedRecord):
    """Worst residuals of the optimality conditions."""

    negative_force: float
    negative_gap: float
    complementarity: float
    equilibrium: float


@dataclass(frozen=True)
class CertificateRecord(ClosedRecord):
    """The proof of what was predicted."""

    states: int
    max_residual: float
    residuals: ResidualsRecord
    fallbacks: int
    cross_check: CrossCheck | None


@dataclass(frozen=True)
class UnknownRecord(ClosedRecord):
    """A deviation that is not known: the range that it may have, in the unit of its field, and why."""

    field: str
    range: tuple[float, float]
    reason: str


@dataclass(frozen=True)
class EndsRecord(ClosedRecord):
    """F'_ior [arcsec] at a torque [N*m], at both ends of what was computed of a range."""

    M_g_Nm: float
    F_ior_arcsec: tuple[float, float]


@dataclass(frozen=True)
class RestsOnRecord(ClosedRecord):
    """An assumption that predictions rest on: its plausible range, and how much of it was computed."""

    field: str
    assumed_range: tuple[float, float]
    computed_range: tuple[float, float]
    effect: tuple[EndsRecord, ...]

    @property
    def words(self) -> str:
        """In words: what F'_ior comes to at the torque where it moves most."""
        most = max(self.effect, key=lambda e: max(e.F_ior_arcsec) / max(min(e.F_ior_arcsec), 1e-3))
        (low, high), (least, greatest) = self.computed_range, sorted(most.F_ior_arcsec)
        return f"{self.field} {short(low)} to {short(high)}: {least:.1f} to {greatest:.1f} at {most.M_g_Nm:g} N·m"


def certificate_of(predictions: Predictions) -> CertificateRecord:
    """The proof of predictions, and its cross-check."""
    found, crossed = predictions.certificate, predictions.cross_checks
    residuals = ResidualsRecord(found.negative_force, found.negative_gap, found.complementarity, found.equilibrium)
    cross_check = None
    if crossed:
        worst_of_all = max(c.max_difference_arcsec for c in crossed)
        cross_check = CrossCheck(crossed[0].solver, sum(c.states for c in crossed), worst_of_all)
    return CertificateRecord(found.states, found.max_residual, residuals, found.fallbacks, cross_check)


def unknown_of(predictions: Predictions) -> tuple[UnknownRecord, ...]:
    """What predictions take as 0 because nobody knows it."""
    return tuple(UnknownRecord(each.path, (each.low, each.high), each.reason) for each in predictions.unknown)


def rests_on_of(predictions: Predictions) -> tuple[RestsOnRecord, ...]:
    """What predictions rest on, the greatest effect on F'_ior first."""
    return tuple(
        RestsOnRecord(
            effect.assumption.path,
            (effect.assumption.low, effect.assumption.high),
            effect.ends,
            tuple(
                EndsRecord(M_g, (float(ends[0]), float(ends[1])))
                for M_g, ends in zip(predictions.errors, effect.F_ior_arcsec, strict=True)
            ),
        )
        for effect in predictions.rests_on
    )
