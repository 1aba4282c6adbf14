"""What was measured on a drive is evidence of it: each figure narrows what is not known, and a wrong one is named."""

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.evidence import EVIDENCE, FIGURE, drawn, rows_of_page
from hdassist import load_preset
from hdassist.belief.evidence import (
    MISFITS,
    MISREAD,
    MISREAD_SHARE,
    SCALE,
    Evidence,
    evidence_of,
    kernel,
    log_likelihood,
    log_likelihood_of_errors,
    stiffness_figures,
)
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.drive.error.error_map import ErrorMap
from hdassist.features.mounting.positions import rotated
from hdassist.run.errors import UntrustedError, Verdict
from tests.helpers.process import TINY

W_0 = "source.cam.W_0={kind: assumed, range: [1.6, 1.8], ref: judged}"
J_N = "source.gears.j_n={kind: assumed, range: [16, 20], ref: judged}"
UNKNOWN = ("phases.phi_hb=unknown", "tolerances.e_hb=unknown", "mounting.holes=6")
FEW = SamplingEffort(effective=8, settling_draws=8, most_draws=512, batch=64)


def tiny(*overrides: str):
    return load_preset(TINY, ["operation.M_g=4", *overrides])


def believed(drive, torques=(), effort=FEW):
    return draw_samples(prior_of(drive), torques, evidence=evidence_of(drive), effort=effort)


@pytest.mark.thorough
@pytest.mark.moves("measured.K_1", "measured.K_2", "measured.K_3", "measured.lost_motion", "measured.play")
@pytest.mark.parametrize("figure", ["K_1", "K_2", "K_3", "lost_motion", "play"])
def test_measured_figure_narrows_the_radial_deflection(figure):
    value = stiffness_figures(tiny("cam.W_0=1.62", "gears.j_n=17"))[0][figure]
    off = []
    for spread in (0.1, 4.0):
        samples = believed(tiny(W_0, J_N, f"measured.{figure}={value} ± {spread * value}"))
        found = np.log(np.maximum(samples.figures[figure], 1) / value)
        off.append(np.sqrt(samples.weights @ found**2 / samples.weights.sum()))
    assert off[0] < 0.95 * off[1]  # K_1 of whole flanks is believed to 30 % only


@pytest.fixture(scope="module")
def hidden():
    """F'_ior [arcsec] of a drive in three holes of its seat."""
    drive = tiny("phases.phi_hb=20", "tolerances.e_hb=8", "mounting.holes=6")
    return {hole: ErrorMap(drive, 4.0).extremes(rotated(drive, 60.0 * hole)).first for hole in (0, 2, 4)}


@pytest.mark.thorough
@pytest.mark.moves("measured.F_ior")
def test_errors_in_holes_narrow_F_ior_and_eccentricity_direction(hidden):
    readings = ", ".join(f"h{hole}@4: {value} ± 0.5" for hole, value in hidden.items())
    open_, known = (tiny(*UNKNOWN, *more) for more in ((), (f"measured.F_ior={{{readings}}}",)))
    before, after = (believed(drive, (4.0,), SamplingEffort(24, 24, 1024, 128)) for drive in (open_, known))
    low, high = (after.percentile(share, 0) for share in (0.05, 0.95))
    assert low < hidden[0] < high
    assert high - low < 0.7 * (before.percentile(0.95, 0) - before.percentile(0.05, 0))
    (k,) = (k for k, each in enumerate(after.prior.fields) if each.path == "phases.phi_hb")
    off = np.abs((360 * after.shares[:, k] - 20 + 180) % 360 - 180)
    assert weighted_quantile(off, after.weights, 0.5) < 45  # of any direction: 90


def test_deviation_draws_in_groups_of_four_share_one_stiffness(hidden):
    readings = ", ".join(f"h{hole}@4: {value} ± 0.5" for hole, value in hidden.items())
    samples = believed(tiny(*UNKNOWN, W_0, f"measured.F_ior={{{readings}}}"), (4.0,), SamplingEffort(1, 1, 16, 16))
    of_field = dict(zip((each.path for each in samples.prior.fields), samples.shares.T, strict=True))
    assert [len(np.unique(four)) for four in of_field["cam.W_0"].reshape(-1, 4)] == [1] * 4
    assert len(np.unique(of_field["cam.W_0"])) == 4
    offsets = np.stack([of_field["tolerances.e_hb"], of_field["phases.phi_hb"]])
    chosen = offsets[:, samples.weights > 0]  # one that is chosen twice counts twice, in one place
    assert np.unique(chosen, axis=1).shape == chosen.shape
    assert chosen.shape[1] > 4


def test_error_likelihood_includes_scale_misfit_noise_and_one_reading_error():
    y, f, told = np.array([[24.0, 15.0, 20.0], [25.0, 15.5, 28.0], [0.5, 1.0, 0.5]])
    turns, right = (0.0, 60.0, 180.0), (1 - MISREAD) ** 3

    def density(f):
        total = 0.0
        for wrong in (-1, 0, 1, 2):
            spread = np.where(np.arange(3) == wrong, np.hypot(told, MISREAD_SHARE * y), told)
            for misfit in MISFITS:
                both = (misfit * f.mean()) ** 2 * kernel(turns, turns) + SCALE**2 * np.outer(f, f) + np.diag(spread**2)
                share = (right if wrong < 0 else (1 - right) / 3) / len(MISFITS)
                total += share * np.exp(-0.5 * (y - f) @ np.linalg.solve(both, y - f)) / np.sqrt(np.linalg.det(both))
        return total

    found = log_likelihood_of_errors(f[None], y, told, kernel(turns, turns))
    assert found == pytest.approx([np.log(density(f) / density(y))], rel=1e-9)


def test_errors_at_one_torque_share_scale_and_smooth_misfit():
    def readings(*places):
        return tuple(
            Evidence(f"measured.F_ior.{k}", f"{k}", 20.0, 0.1, "difference", *at) for k, at in enumerate(places)
        )

    def heard(evidence, *predicted):
        return log_likelihood(evidence, {str(k): value for k, value in enumerate(predicted)})

    near = readings((4.0, 0.0), (4.0, 10.0))
    assert heard(near, 20, 20) == 0
    assert heard(near, 22, 22) > heard(near, 22, 18)  # both off by a tenth is one tenth of scale
    at_another_torque = readings((4.0, 0.0), (8.0, 10.0))  # the misfit is another
    assert heard(at_another_torque, 21, 19) > heard(near, 21, 19)


@pytest.mark.thorough
def test_a_measured_figure_that_contradicts_is_named(hidden):
    readings = ", ".join(f"h{hole}@4: {value * (9 if hole == 2 else 1)} ± 0.5" for hole, value in hidden.items())
    drive = tiny(
        "phases.phi_hb=unknown",
        "tolerances.e_hb=8",
        "mounting.holes=6",
        f"measured.F_ior={{{readings}}}",
        "measured.play=5 ± 5",
    )
    with pytest.raises(UntrustedError, match=r"measured\.F_ior\.h2@4 = .* contradicts the other reference data"):
        believed(drive, (4.0,), SamplingEffort(48, 48, 48, 48))


def test_errors_that_no_draw_shows_are_refused():
    drive = tiny("phases.phi_hb=unknown", "mounting.holes=6", "measured.F_ior={h0@4: 5 ± 1, h2@4: 4 ± 1}")
    words = r"no sampled drive reproduces .*: measured\.F_ior\.h0@4 is 5, .* from \d+.* to \d+.*h2@4 is 4"
    with pytest.raises(UntrustedError, match=words):
        believed(drive, (4.0,), SamplingEffort(4, 4, 16, 4))


@pytest.mark.thorough
def test_evidence_that_is_only_narrow_contradicts_nothing(hidden):
    readings = ", ".join(f"h{hole}@4: {value} ± 0.5" for hole, value in hidden.items())
    drive = tiny(*UNKNOWN, f"measured.F_ior={{{readings}}}", "catalogue.accuracy=1000")
    few = SamplingEffort(64, 64, 64, 64)
    with pytest.raises(
        UntrustedError, match=r"all reference data at once, although no single value contradicts the others"
    ):
        believed(drive, (4.0,), few)
    # eight effective ones are an answer that says how few they are; no verdict rests on the point
    samples = believed(drive, (4.0,), replace(few, least=8))
    assert 8 <= samples.effective < 64 and samples.draws == 64
    assert re.match(
        rf"effective sample size {samples.effective:.3g} from 64 samples, 64 "
        rf"required, so",
        *samples.remarks,
    )
    every = samples.probability_within(2 * samples.F_ior_arcsec.max(), 0)
    assert (every.value, every.verdict()) == (1.0, Verdict.INCONCLUSIVE)
    assert every.text(0.95).endswith("PASS needs 95 % over the whole interval")
    assert every.verdict(sure=0.6) is Verdict.PASS


def test_other_drives_of_a_type_share_only_the_stiffness():
    drive = tiny("measured={K_2: 1400 ± 140, lost_motion: 80, play: 0 ± 1, F_ior: {0@4: 20 ± 1}}")
    own, others = evidence_of(drive), evidence_of(drive, of_type=True)
    assert [each.path for each in own] == [
        "measured.K_2", "measured.lost_motion", "measured.play", "measured.F_ior.0@4"
    ]  # fmt: skip
    assert [each.path for each in others] == ["measured.K_2"]
    assert own[0].spread == pytest.approx(np.hypot(0.10, 0.05))
    assert others[0].spread == pytest.approx(np.hypot(0.15, 0.05))


def test_the_uncertainty_of_a_figure_is_no_field_to_draw():
    assert prior_of(tiny("measured.K_2=1400 ± 140", "catalogue.K_2=1400 ± 140")).fields == ()
    assert evidence_of(tiny("catalogue.K_2=1400 ± 140"))[0].spread == pytest.approx(np.hypot(0.15, 0.05))


def test_the_figure_shows_the_table_of_its_page():
    assert [words for words, _ in rows_of_page()] == list(EVIDENCE)
    assert FIGURE.read_text(encoding="utf-8") == drawn(), "python -m benchmarks.evidence --picture"
