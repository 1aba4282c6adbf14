"""Check, mounting advice and stiffness of one drive."""

from __future__ import annotations

from dataclasses import dataclass

from hdassist.belief.samples import EFFECTIVE_SAMPLES
from hdassist.design.check import DesignCheck, check, check_states
from hdassist.error.stiffness import Stiffness, stiffness, stiffness_states
from hdassist.mounting.advice import Advice, advice_states, advise
from hdassist.mounting.positions import seat_positions
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import Certificate
from hdassist.solve.throughcvxpy import CrossCheck


@dataclass(frozen=True, eq=False)
class DriveSheet:
    """Check of a drive, advice where to mount its wheel, and its stiffness."""

    check: DesignCheck
    advice: Advice
    stiffness: Stiffness

    @property
    def drive(self) -> Drive:
        """The drive."""
        return self.check.drive

    @property
    def certificate(self) -> Certificate:
        """Worst residuals of all three."""
        return self.check.certificate + self.advice.certificate + self.stiffness.certificate

    @property
    def cross_checks(self) -> tuple[CrossCheck | None, ...]:
        """Cross-checks of all three."""
        return (*self.check.cross_checks, *self.advice.cross_checks, self.stiffness.cross_check)


def sheet_states(drive: Drive, draws: int = EFFECTIVE_SAMPLES) -> int:
    """Number of states that a sheet solves, about, for a progress bar."""
    mounting = advice_states(drive, len(seat_positions(drive)), draws=draws)
    return check_states(drive, draws=draws) + mounting + stiffness_states()


def sheet_of(drive: Drive, *, draws: int = EFFECTIVE_SAMPLES, run: Run = Run()) -> DriveSheet:
    """Check a drive, look for its best position and compute its stiffness, each as the command of that name does.

    Argument: draws, from the unknown fields. Raises UntrustedError where an answer cannot be trusted.
    """
    advice = advise(drive, drive.operation.M_g, seat_positions(drive), draws=draws, run=run)
    checked = check(drive, draws=draws, samples=advice.samples, run=run)
    return DriveSheet(checked, advice, stiffness(drive, run=run))
