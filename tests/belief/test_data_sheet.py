"""A drive of which only a data sheet is known, against a study with another seed and Gaussian likelihoods."""

import numpy as np
import pytest

from hdassist.belief.evidence import evidence_of
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import weighted_quantile
from hdassist.loading import load_text
from tests.process import run


@pytest.mark.slow
def test_stiffness_and_lost_motion_narrow_the_error_and_the_wave_of_a_data_sheet_drive():
    asked = ("--ratio", "100", "--pitch-diameter", "63.5", "--torque", "67", "--stiffness", "3.1e4,5.0e4,5.7e4")
    text = run("presets", "new", "sheet", *asked).stdout
    drive = load_text(text, "sheet.yaml", ["catalogue.lost_motion=60"])
    prior = prior_of(drive)
    samples = draw_samples(prior, (6.7,), evidence=evidence_of(drive), effort=SamplingEffort(effective=128))
    # 1535 draws by another seed, normal likelihoods, 201 effective: F'_ior 17.4 ± 1.8, 36.5 ± 1.5, 117.9 ± 10.8 arcsec;
    # W_0 0.372 to 0.402 mm
    found = [samples.percentile(share, 0) for share in (0.05, 0.5, 0.95)]
    error = [samples.percentile_error(share, 0) for share in (0.05, 0.5, 0.95)]
    expected = ((17.4, 1.8), (36.5, 1.5), (117.9, 10.8))
    for value, own, (other, others) in zip(found, error, expected, strict=True):
        assert abs(value - other) < 3 * np.hypot(own, others)
    (k,) = (k for k, each in enumerate(prior.fields) if each.path == "cam.W_0")
    W_0 = prior.fields[k].value(samples.shares[:, k])
    for share, other in ((0.05, 0.3724), (0.95, 0.4015)):
        step = np.sqrt(share * (1 - share) / samples.effective)
        low, high = (weighted_quantile(W_0, samples.weights, share + s) for s in (-step, step))
        off = weighted_quantile(W_0, samples.weights, share) - other
        assert abs(off) < 3 * (high - low) / 2 * np.hypot(1, (128 / 201) ** 0.5)
