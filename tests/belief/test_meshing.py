"""Teeth that mesh: the shift of the circular spline follows from all else, by the play of the drives that come out."""

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.belief.draws import meshing_shift
from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import PRELOAD, RIGID_SHIFT, prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.model.rules import first_conflict
from hdassist.drive.preset.knowledge import read_requirements
from hdassist.run.run import UNCHECKED

FEW = SamplingEffort(effective=8, settling_draws=16, most_draws=32, batch=8)


def sheet(*overrides: str):
    """A drive of which a data sheet says ratio and size."""
    like = load_preset("vzp160")
    text = similar_preset("own", like, read_requirements(like, ratio=50, pitch_diameter="63.5", torque="40"))
    return load_text(text, "own", ["operation.M_g=4", *overrides])


def play(drive) -> float:
    return stiffness(drive, points=1, run=UNCHECKED).play_arcsec


@pytest.mark.parametrize("wave", [1.12, 1.2, 1.26])
def test_backlash_begins_at_the_meshing_shift_and_grows_with_shift(wave: float) -> None:
    drive = sheet().with_values({"cam.W_0": wave * sheet().gears.m, "bearing.g_b": 4.0})
    shift = meshing_shift(drive)[0]

    def play_beyond(beyond: float) -> float:
        return play(drive.with_values({RIGID_SHIFT: shift + beyond}))

    assert play_beyond(-0.005) < 0.3 and play_beyond(0) < 0.3
    # flanks that stand 0.01 modules of shift apart, each by its sine of the pressure angle, at the base circle
    expected = np.degrees(2 * 0.01 * np.tan(np.radians(20)) / 50) * 3600
    assert 0 <= expected - play_beyond(0.01) < 5  # where it begins, one flank after the other comes free
    assert play_beyond(0.02) - play_beyond(0.01) == pytest.approx(expected, rel=0.01)


@pytest.mark.moves("catalogue.play")
def test_data_sheet_drives_meet_their_backlash_at_any_radial_deflection() -> None:
    drive = sheet()
    prior = prior_of(drive)
    samples = draw_samples(prior, (4.0,), evidence=evidence_of(drive), effort=FEW)
    assert samples.effective > 0.9 * samples.draws  # none is weeded for its play
    assert np.median(samples.figures["play"]) < 5
    W_0 = [values["cam.W_0"] for values in samples.values()]
    shifts = [values[RIGID_SHIFT] for values in samples.values()]
    assert np.ptp(W_0) > 0.1 * drive.gears.m * 1.5
    assert np.corrcoef(W_0, shifts)[0, 1] > 0.7
    for values in samples.values()[:3]:
        there = drive.with_values(values)
        assert first_conflict(there) is None
        (_, field) = prior.meshing
        beyond = values[RIGID_SHIFT] - meshing_shift(there)[0]
        assert -PRELOAD - 1e-9 <= beyond <= field.high + 1e-9


def test_shift_is_kept_if_given_or_without_stated_backlash() -> None:
    assert prior_of(sheet()).meshing
    found = "source.gears.j_n={kind: identified, ref: by calibrate}"
    for override in ("gears.x_b=3.3", "catalogue.play=", "source.gears.x_b={kind: given, ref: drawing}", found):
        assert not prior_of(sheet(override)).meshing, override
    wide = prior_of(sheet("source.gears.x_b={kind: assumed, range: [2.3, 2.6], ref: judged}"))
    assert {each.path: each.distribution for each in wide.fields}[RIGID_SHIFT] == "even"
    assert not prior_of(load_preset("vzp160")).meshing
