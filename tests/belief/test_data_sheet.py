"""A drive of which only a data sheet is known, against plain draws of the prior that normal likelihoods weigh."""

import numpy as np
import pytest

from hdassist.belief.evidence import evidence_of, stiffness_figures
from hdassist.belief.prior import prior_of
from hdassist.belief.samples import SamplingEffort, draw_samples
from hdassist.belief.statistics import effective_number, weighted_quantile
from hdassist.drive.loading import load_text
from hdassist.run.run import Run
from tests.helpers.process import run

PLAIN = 768  # draws


@pytest.mark.slow
def test_stiffness_and_lost_motion_narrow_error_and_radial_deflection():
    asked = ("--ratio", "100", "--pitch-diameter", "63.5", "--torque", "67", "--stiffness", "3.1e4,5.0e4,5.7e4")
    text = run("presets", "new", "sheet", *asked).stdout
    drive = load_text(text, "sheet.yaml", ["catalogue.lost_motion=60"])
    prior, evidence = prior_of(drive), evidence_of(drive)
    samples = draw_samples(prior, (6.7,), evidence=evidence, effort=SamplingEffort(effective=128))
    # another seed, no draw left out, no proposal: each draw of the prior weighed as a whole
    effort = SamplingEffort(PLAIN, PLAIN, 4 * PLAIN, 64)
    plain = draw_samples(prior, (6.7,), figures_of=stiffness_figures, effort=effort, run=Run(seed=1))
    log = np.zeros(len(plain.weights))
    for each in evidence:
        over = plain.figures[each.figure] / each.value
        log -= 0.5 * ((np.log(over) if each.kind == "ratio" else np.maximum(over - 1, 0)) / each.spread) ** 2
    weights = np.exp(log)
    (k,) = (k for k, each in enumerate(prior.fields) if each.path == "cam.W_0")
    W_0, of_plain = (prior.fields[k].value(found.shares[:, k]) for found in (samples, plain))
    for own, other, shares in (
        (samples.F_ior_arcsec[:, 0], plain.F_ior_arcsec[:, 0], (0.05, 0.5, 0.95)),
        (W_0, of_plain, (0.05, 0.95)),
    ):
        for share in shares:
            (found, error), (expected, its_error) = (
                (weighted_quantile(values, w, share), error_of(values, w, share))
                for values, w in ((own, samples.weights), (other, weights))
            )
            assert abs(found - expected) < 3 * np.hypot(error, its_error)


def error_of(values, weights, share):
    """Monte Carlo error of a percentile: half of what lies between those a standard deviation of its share apart."""
    step = np.sqrt(share * (1 - share) / effective_number(weights))
    low, high = (weighted_quantile(values, weights, share + s) for s in (-step, step))
    return (high - low) / 2
