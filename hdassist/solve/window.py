"""The flank window of a drive, widened where teeth at its edge carry load."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hdassist.errors import Fault, UntrustedError
from hdassist.preset.fields import Drive
from hdassist.preset.overrides import overridden

FIELD = "numerics.window"
WIDER, WIDEST_WINDOW = 1.5, 85.0  # a window over the one before; deg, the most that a preset may have
Result = TypeVar("Result")


class EdgeOfWindowError(UntrustedError):
    """Teeth at the edge of the flank window carry load: others beyond it may do so too."""

    fault = Fault.EDGE_OF_WINDOW


def in_wide_enough_window(drive: Drive, analysis: Callable[[Drive], Result]) -> Result:
    """What an analysis says of a drive; where its flank window is too narrow, of the drive with a wider one.

    All of an answer is made in one window, as if that had been asked for; overrides and warnings of the drive that the
    analysis was given say so. Raises what the analysis raises, EdgeOfWindowError only from the widest window.
    """
    there = drive
    while True:
        try:
            return analysis(there)
        except EdgeOfWindowError:
            if there.numerics.window >= WIDEST_WINDOW:
                raise
            there = with_window(drive, round(min(WIDER * there.numerics.window, WIDEST_WINDOW), 1))


def with_window(drive: Drive, window: float) -> Drive:
    """The drive with a flank window [deg], and a warning where that is another one than its own."""
    own = drive.numerics.window
    if window == own:
        return drive
    warning = (
        f"teeth carry load at the edge of the flank window of {own:g}°: computed anew in one of {window:g}°; "
        f"--set {FIELD}={window:g} makes it permanent"
    )
    return overridden(drive, FIELD, window, warning)
