"""A correction from a record of the full cycle alone, without a preset: all that is known of a line is the record."""

from __future__ import annotations

import numpy as np

from hdassist.comparing.record import Alignment
from hdassist.correction.correct import Correction, fitted_correction, recorded_belief
from hdassist.correction.forms import CorrectionForm
from hdassist.correction.records import RecordedError
from hdassist.errors import UntrustedError, UsageError
from hdassist.measuring.measure import Measurement
from hdassist.model.kinematics import Kinematics
from hdassist.planning.lines import ErrorLines
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY


def correction_alone(
    found: Measurement, asked: Alignment, M_g: float, form: CorrectionForm, output_turns: str | None = None
) -> Correction:
    """Correction from a record at a torque M_g [N*m] that was measured with its ratio, both directions as one.

    Arguments: asked, how the file counts; of two encoders that count alike their record shows which way the
    output turns; else output_turns says so: "with" the cam or "against" it. Raises UsageError for a
    table over the output turn without that, and for angles of the output, UntrustedError for less than the full cycle.
    """
    trace, sweep, gearing = found.trace, found.directions[0], found.gearing
    way = output_turns or {1: "with", -1: "against"}.get(trace.sense)
    if gearing is None or (form.turn == "output" and not way) or trace.angle_of == "output":
        raise UsageError(
            "a record alone does not tell whether cam and output turn the same way",
            "say it: --output-turns against (a fixed rigid wheel) or with, beside cam angles; or take a preset",
        )
    if sweep.is_bound:
        share = f"{100 * sweep.coverage.share:.0f} % of the full cycle" if sweep.coverage else "no full cycle"
        words = f"{trace.file}: {share}, in which lines that lie close together are not told apart"
        raise UntrustedError(words, "record the full cycle, or with a preset: hdassist compensate PRESET FILE")
    moving = round(2 * gearing.ratio)
    kinematics = Kinematics(moving, moving + 2, "rigid")
    if way == "with":
        kinematics = Kinematics(moving - 2, moving, "flexspline")
    none_known = ErrorLines(kinematics, np.zeros(0, dtype=np.int64), np.zeros((1, 0), dtype=complex), EMPTY)
    alignment = asked.of_file(trace, kinematics)
    record = RecordedError(alignment.sense * sweep.bins.turns, alignment.sign * sweep.fit.error)
    error = recorded_belief(none_known, record, Run(seed=found.seed))
    return fitted_correction(None, {M_g: error}, form, {M_g: record}, trace.file)
