"""What a stored correction leaves in each position of the fixed wheel, over the samples that its choice rests on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from hdassist.correction.correct import loaded_error, ranges_left
from hdassist.correction.forms import CAM_POINTS, TRIED_POINTS, USUAL_POINTS, CorrectionForm
from hdassist.error.waves import WAVE_POINTS
from hdassist.errors import UsageError
from hdassist.model.deviations import carried
from hdassist.model.kinematics import Kinematics
from hdassist.mounting.advice import Advice
from hdassist.mounting.decision import Decision
from hdassist.preset.fields import Drive
from hdassist.run.run import Run
from hdassist.solve.answers import EMPTY


def form_of_text(text: str) -> CorrectionForm:
    """A form like phasors, phasors:80, output:720, cam or half-cam. Raises UsageError for any other text."""
    name, _, points = text.partition(":")
    usual = {"phasors": TRIED_POINTS[None][-1], "output": USUAL_POINTS, "cam": CAM_POINTS, "half-cam": CAM_POINTS}
    number = int(points) if points.isdecimal() else usual.get(name, 0) if not points else 0
    if name not in usual or not 2 <= number <= 100000:
        expected = "expected a form and its points, such as output:720"
        raise UsageError(f"invalid --compensated {text}: {expected}", f"forms: {', '.join(usual)}")
    turn = None if name == "phasors" else name
    return CorrectionForm(turn, number)  # type: ignore[arg-type]  # one of the names above, which a text cannot show


def advice_corrected(advice: Advice, form: CorrectionForm, draws: int, run: Run) -> Advice:
    """An advice by what a correction leaves that is made in each position and for each torque.

    Where that tells no hole from another, the advice as it was. Arguments: draws, drives of the same weight, from the
    samples of the advice. The error of each drive is that of its own lines there, as if it were recorded in that
    position, with all that these lines do not have.
    """
    drive, found, drives = advice.drive, advice.decision, [dict[str, float]()]
    if found.all_alike:
        return advice
    if found.is_sampled and advice.samples:
        drives = advice.samples.of_ranges.equal_drives(draws)
    every, proof, left = sorted({0.0, *found.rotations_deg}), EMPTY, []
    for rotation_deg in every:
        changes = [turned(drive, values, rotation_deg) for values in drives]
        for M_g in advice.torques:
            error, of_states = loaded_error(drive, M_g, changes, run, alike=len(drives) == 1)
            proof += of_states
            left.append(ranges_left(form.fitted(error.lines, M_g), error)[0])
    arcsec = np.reshape(left, (len(every), -1, len(drives))).transpose(1, 2, 0)  # (torques, drives, positions)
    columns = [every.index(each) for each in found.rotations_deg]
    ones, now = np.ones(len(drives)), arcsec[..., every.index(0.0)]
    decision = Decision(found.rotations_deg, arcsec[..., columns], now, ones, (), found.cost)
    curve = advice.curve and replace(advice.curve, certificate=advice.curve.certificate + proof)
    advice = replace(advice, curve=curve, compensated=(form.name, decision))
    return advice if decision.word(advice.sure) == "ANY_HOLE" else replace(advice, decision=decision, value=None)


def corrected_states(drive: Drive, positions: int, draws: int) -> int:
    """Number of states that this solves, about, for a progress bar."""
    cycle = Kinematics.of(drive).cycle_states
    return len(drive.operation.M_g) * positions * (cycle + max(1, draws) * WAVE_POINTS**2)


def turned(drive: Drive, values: Mapping[str, float], rotation_deg: float) -> dict[str, float]:
    """Values by path of a drive with its fixed wheel turned on its seat [deg]."""
    directions = {path: values.get(path, drive.number(path)) + rotation_deg for path in carried(drive)}
    return {**values, **directions}
