"""What predictions rest on, as the files of `hdassist accept` have it: proof, what is assumed, what is not known."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from typing import Literal

import numpy as np

from hdassist.acceptance.predictions import Predictions
from hdassist.model.wheels import MeasuredTeeth, MeasuredWheel
from hdassist.preset.kinds import Line, short
from hdassist.run.kept import ClosedRecord
from hdassist.solve.certificate import TOLERANCE
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

    @property
    def is_sound(self) -> bool:
        """Whether it proves anything: states, and residuals within their tolerance."""
        found = astuple(self.residuals)
        return self.states > 0 and self.fallbacks >= 0 <= min(found) and self.max_residual == max(found) <= TOLERANCE


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


@dataclass(frozen=True)
class WheelRecord(ClosedRecord):
    """A measured wheel (b rigid, g flexspline): its pitch file, where its mark stands, and what was assumed of it."""

    wheel: Literal["b", "g"]
    file: Line
    sha256: str
    mark_tooth: int
    mark_deg: float
    flank: Literal["left", "right"] | None
    range_um: float
    notes: tuple[str, ...]


def wheels_of(measured: MeasuredTeeth | None) -> tuple[WheelRecord, ...]:
    """The measured wheels that predictions are of."""
    return tuple(
        WheelRecord(
            name, wheel.pitch.file, wheel.pitch.sha256, wheel.pitch.mark, wheel.mark_deg, wheel.pitch.flank,
            float(np.ptp(wheel.pitch.deviation)), wheel.pitch.notes,
        )
        for name, wheel in (_named(measured) if measured else ())
        if wheel is not None
    )  # fmt: skip


def _named(measured: MeasuredTeeth) -> tuple[tuple[Literal["b", "g"], MeasuredWheel | None], ...]:
    return ("b", measured.b), ("g", measured.g)


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
