"""Test of corrections from recordings on hidden drives: `python -m benchmarks.compensate`.

Each hidden drive is one of `benchmarks.honesty` with a small ratio, which is computed quickly. It has other
stiffnesses, wave, supports, clearances, flanks and temperature than the preset, and teeth with harmonics of every order
and noise. Its full cycle at the first torque is recorded with noise. Before the recording, spectral lines are assumed
as large as in samples of the prior, without the data sheet. The correction from the recording is compared with the
solved cycle: whether the residual is at most the predicted one (95 %), whether the drive is worse with the correction
than without, and which residual a plain table over one input revolution leaves, the mean over the revolutions of the
same recording. With --allowed, the hidden drive is one that the preset allows, so a recording of a part of the cycle
(--span 0.4) can be fitted by the preset.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hdassist.drive.model.geometry import Array

NOISE_ARCSEC = 0.5  # standard deviation of a reading
RATIOS = (30, 40, 50)
POINTS = 1500  # points of the table over one output revolution


@dataclass(frozen=True)
class CorrectedDrive:
    """Ranges of the error of a hidden drive with and without a correction [arcsec].

    uncorrected: range without a correction.
    left: residual range with the correction.
    promised: 95th percentile of the predicted residual range.
    plain: residual range with the plain table over one input revolution.
    refused: reason why there is no correction, empty if there is one.
    """

    uncorrected: float = np.nan
    left: float = np.nan
    promised: float = np.nan
    plain: float = np.nan
    refused: str = ""


def corrected(number: int, draws: int, seed: int, span: float, allowed: bool = False) -> dict[str, CorrectedDrive]:
    """Return the residuals of a hidden drive with each form of correction.

    number: number of the drive.
    draws: number of samples of the prior.
    seed: seed of all drives.
    span: recorded part of the cycle.
    allowed: whether the preset allows the drive.
    """
    from benchmarks.honesty import hidden_drive
    from hdassist.belief.prior import prior_of
    from hdassist.drive.error.cycle import kinematic_error
    from hdassist.drive.model.geometry import Kinematics
    from hdassist.drive.model.rules import first_conflict
    from hdassist.features.correction.correct import PHASORS, correct, correction_of
    from hdassist.features.correction.forms import CAM_POINTS, CorrectionForm
    from hdassist.features.correction.records import fitted_prior, recorded_error
    from hdassist.features.measuring.measure import measure
    from hdassist.features.record_comparison.record import Alignment
    from hdassist.readers.trace import MeasuredTrace, sweeps
    from hdassist.run.errors import HdassistError
    from hdassist.run.run import UNCHECKED, Run

    rng = np.random.default_rng([seed, number])
    tables = (CorrectionForm("output", POINTS), CorrectionForm("cam", CAM_POINTS))
    try:
        preset, there, teeth = hidden_drive(rng, RATIOS)
        while allowed:
            fitted = fitted_prior(preset)
            there, teeth = preset.with_values(fitted.values(rng.random((1, len(fitted.fields))))[0]), None
            allowed = first_conflict(there) is not None
        M_g = preset.operation.M_g[0]
        error = kinematic_error(there, M_g, teeth=teeth, run=UNCHECKED)
        turns, actual = error.states.phi_h / (2 * np.pi), -error.error_arcsec
        rows = np.arange(round(span * len(turns)))
        cam_deg = 360 * rows * turns[1]
        readings = -actual[rows % len(turns)] + NOISE_ARCSEC * rng.standard_normal(len(rows))
        trace = MeasuredTrace("run.csv", "", cam_deg, readings, rows + 1, 0.0, tuple(sweeps(cam_deg)), ())
        alone = preset.model_copy(update={"operation": preset.operation.model_copy(update={"M_g": (M_g,)})})
        records = {M_g: recorded_error(measure(trace, drive=alone, together=True), Kinematics.of(alone), Alignment())}
        found: dict[str, CorrectedDrive] = {}
        if span < 1:
            result = correct(alone, records=records, draws=draws, run=Run(seed=number))
        else:
            prior = prior_of(alone)
            values = prior.values(prior.shares(2 * draws, number))
            drives = [each for each in values if first_conflict(alone.with_values(each)) is None][:draws]
            result = correction_of(alone, drives, records, PHASORS, Run(seed=number))
        lines, plain = result.errors[M_g].lines, plain_left(turns, actual, rows, -readings)
        for form in (result.chosen.form, *tables):
            stored = next(each for each in result.forms if each.form == form)
            left = float(np.ptp(actual - form.fitted(lines.mean, M_g).error_at(turns)[0]))
            refused = "refused" if stored.is_refused else ""
            promised = stored.residuals[0].p95
            found[form.turn or "phasors"] = CorrectedDrive(float(np.ptp(actual)), left, promised, plain, refused)
    except HdassistError as fault:
        return {form: CorrectedDrive(refused=fault.message) for form in ("phasors", "output", "cam")}
    return found


def plain_left(turns: Array, actual: Array, rows: NDArray[np.int64], read: Array) -> float:
    """Return the residual range with a table over one input revolution, the mean over its revolutions [arcsec].

    turns: input angles of the solved cycle [rev].
    actual: error of the solved cycle [arcsec].
    rows: index of each reading in the cycle.
    read: recorded errors [arcsec].
    """
    place = np.floor(np.mod(turns, 1) * 200).astype(int) % 200
    seen = place[rows % len(place)]
    means = np.bincount(seen, read, 200) / np.maximum(np.bincount(seen, minlength=200), 1)
    return float(np.ptp(actual - means[place]))


def main() -> None:
    """Correct drives, and print how often the residual was at most the predicted one."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--n", type=int, default=20, help="hidden drives")
    parser.add_argument("--draws", type=int, default=8, help="draws of the prior")
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--span", type=float, default=1.02, help="of the cycle, that a record has")
    parser.add_argument("--seed", type=int, default=2)
    parser.add_argument("--allowed", action="store_true", help="hidden drives that the preset allows")
    args = parser.parse_args()
    found: dict[str, list[CorrectedDrive]] = {}
    for number in range(args.first, args.first + args.n):
        for name, each in corrected(number, args.draws, args.seed, args.span, args.allowed).items():
            found.setdefault(name, []).append(each)
            words = f"{each.uncorrected:.1f} to {each.left:.2f}, promised {each.promised:.2f}, plain {each.plain:.1f}"
            print(number, name, words, each.refused, flush=True)
    for name, drives in found.items():
        made = [each for each in drives if not each.refused]
        kept = sum(each.left <= each.promised for each in made)
        worse = sum(each.left > each.uncorrected for each in made)
        better = sum(each.left < each.plain for each in made)
        share = np.median([each.left / each.uncorrected for each in made]) if made else np.nan
        print(f"{name}: {len(made)} of {len(drives)} corrected, promise kept {kept}, worse than without {worse}, "
              f"better than the plain table {better}, median left {100 * share:.1f} %")  # fmt: skip


if __name__ == "__main__":
    main()
