"""A record with the correction on, held against what was promised, and the likely cause where that was not kept."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hdassist.correction.correct import Correction, ErrorPart, correction_curve, error_parts, percentiles
from hdassist.correction.records import RecordedError, recorded_lines
from hdassist.correction.table import ExpectedResidual
from hdassist.model.geometry import Array
from hdassist.planning.lines import POINTS_A_TURN, ErrorLines
from hdassist.run.run import Run
from hdassist.verdict import Verdict

EXPLAINED_RMS_SHARE = 0.5  # of what is left in place, root mean square: a cause that leaves more is none
ALIKE = 1.05  # times the least that a cause leaves: the nearest zero of such is named
IN_ZERO_DEG = 3.0  # of the cam, as far as a zero counts as right


@dataclass(frozen=True)
class VerifiedCorrection:
    """A record with the correction on, at the torque that it is for.

    F_ior_arcsec: of its lines, and its interval, without an upper end of part of the cycle;
    promised; parts: of the error as promised and as it came, of the full cycle only; cause: words for why it does not
    do as was promised.
    """

    F_ior_arcsec: float
    interval_arcsec: tuple[float, float | None]
    promised: ExpectedResidual
    promised_parts: tuple[ErrorPart, ...]
    parts: tuple[ErrorPart, ...]
    cause: str
    verdict: Verdict


def verify(result: Correction, record: RecordedError, run: Run) -> VerifiedCorrection:
    """What a record with the correction on shows, and what was promised.

    Its interval is all that noise leaves open. PASS where that is within the promise at 95 %, FAIL where none of it is.
    """
    promised, error = result.chosen.residuals[0], result.errors[result.M_g]
    lines = recorded_lines(error.lines, record, run)
    F_ior_arcsec = float(np.ptp(lines.mean.curves))
    *_, most = percentiles(np.ptp(lines.curves, axis=1))  # what noise leaves open added, which may have added before
    low = max(0.0, 2 * F_ior_arcsec - most)
    high = None if record.is_part else most
    is_kept = high is not None and high <= promised.p95
    verdict = Verdict.PASS if is_kept else Verdict.FAIL if low > promised.p95 else Verdict.INCONCLUSIVE
    taken = correction_curve(result.correction, error.lines.kinematics).reshape(-1)
    spectrum = np.fft.rfft(taken)[error.lines.per_cycle] * (2 / len(taken))
    left = replace(error.lines, amplitude=error.lines.amplitude + spectrum)
    parts = [error_parts({result.M_g: replace(error, lines=each)}) for each in (left, lines)]
    promised_parts, parts_that_came = ((), ()) if record.is_part else parts
    cause = likely_cause(error.actual.mean(axis=0), taken, record, lines) if verdict is Verdict.FAIL else ""
    return VerifiedCorrection(F_ior_arcsec, (low, high), promised, promised_parts, parts_that_came, cause, verdict)


def likely_cause(before: Array, taken: Array, record: RecordedError, lines: ErrorLines) -> str:
    """Words for the sign and zero with which a correction acts that explain a record best; empty where none does.

    Arguments: error before and correction [arcsec] over the full cycle, shape (points,) each. The square of before less
    after less the correction is least where their correlation is greatest.
    """
    count, points = len(taken), record.points(lines)
    applied = before[points] + record.error_arcsec  # F_kpp is the opposite of the actual error
    applied -= applied.mean()

    def correlation(read: Array, curve: Array) -> Array:
        """Sum over readings by the points that the zero is off, shape (points,)."""
        return np.fft.irfft(np.conj(np.fft.rfft(np.bincount(points, read, count))) * np.fft.rfft(curve), count)

    product, power = correlation(applied, taken), correlation(np.ones(len(points)), taken**2)
    left = applied @ applied + np.stack([power - 2 * product, power + 2 * product, 0 * power])  # as it is, flipped, off
    if left.min() > EXPLAINED_RMS_SHARE**2 * left[0, 0]:
        return ""
    near = np.fft.fftfreq(count, 1 / count)
    way, place = min(np.argwhere(left <= ALIKE * left.min()).tolist(), key=lambda each: (abs(near[each[1]]), each[0]))
    off_turns = float(near[place]) / POINTS_A_TURN
    turns = round(off_turns)
    off_deg = 360 * (off_turns - turns)
    if way == 2:
        return "the correction is not on"
    found = ["its sign is flipped"] * (way == 1)
    found += [f"its zero is off by {abs(off_deg):.0f}° of the cam"] * (abs(off_deg) > IN_ZERO_DEG)
    found += [f"{abs(turns)} turns of the cam are lost"] * bool(turns)
    return ", ".join(found)
