"""Trials from records of the error, and from what a preset has as measured."""

from dataclasses import replace

import numpy as np
import pytest

from hdassist import load_preset
from hdassist.features.measuring.full_cycle import with_full_cycle
from hdassist.features.measuring.measure import Reading, measure
from hdassist.features.mounting.advice import advise_after
from hdassist.features.mounting.posterior import Trial, TrialSetup, hole_samples, posterior_of, read_trial_or_record
from hdassist.readers.trace import read_trace
from hdassist.run.errors import UntrustedError
from tests.helpers.process import SMALL, run
from tests.mounting.drives import COARSE, M_G, told

CYCLE = 30  # cam turns of the drive's full cycle
SETUP = TrialSetup(M_G, noise_arcsec=2.0)


@pytest.fixture
def record(tmp_path):
    """A file with a record of so many cam turns: 12 arcsec at twice a turn, from peak to peak, and some noise."""

    def written(turns: float, noise: float = 0.2):
        angle = np.arange(0, 360 * turns + 1, 5.0)
        error = 6 * np.sin(2 * np.radians(angle)) + noise * np.random.default_rng(1).standard_normal(len(angle))
        rows = "".join(f"{a:.1f},{e:.4f}\n" for a, e in zip(angle, error, strict=True))
        path = tmp_path / f"Run {turns:g} {noise:g}.csv"
        path.write_text(f"cam_deg,error_arcsec\n{rows}")
        return str(path)

    return written


@pytest.mark.usefixtures("short_chains")
def test_recording_as_trial_gives_value_and_uncertainty_of_measure(record):
    drive, file = load_preset(SMALL), record(CYCLE)
    found = read_trial_or_record(f"h4={file}", drive, Reading(), 10.0)
    assert (found.rotation_deg, found.file) == (120, file)
    greatest = with_full_cycle(measure(read_trace(file), drive=drive)).directions[0]
    assert (found.F_ior_arcsec, found.noise_arcsec) == (greatest.F_ior_arcsec, greatest.uncertainty_arcsec)
    assert found.F_ior_arcsec == pytest.approx(12, abs=0.5)
    stated = read_trial_or_record(f"120={file}", drive, Reading(budget=("encoder=3",)), 10.0)
    assert stated.noise_arcsec == pytest.approx(np.hypot(3.0, found.noise_arcsec), rel=0.01)
    assert read_trial_or_record("h4=17.3", drive, Reading(), 10.0) == Trial(120, 17.3)


def test_a_record_of_less_than_the_cycle_is_no_trial(record):
    with pytest.raises(
        UntrustedError, match=r"3 of the 30 input revolutions of the full mesh cycle, so its F'_ior is a lower bound"
    ):
        read_trial_or_record(f"h4={record(3)}", load_preset(SMALL), Reading(), 10.0)


@pytest.mark.parametrize(
    ("trial", "code", "words"),
    [
        ("h4={missing}", 4, "no such file"),
        ("h4={empty}", 4, "the file is empty"),
        ("h4={short}", 4, "less than one input revolution in one direction"),
        ("h4=1,234", 2, "expected F'_ior in arcsec, as in h4=17.3"),  # or are these thousands?
        ("h12={short}", 2, "the seat's holes are h0 to h11"),
        ("x={short}", 2, "expected HOLE=VALUE"),
    ],
)
def test_what_is_no_trial_is_told_before_any_work(record, tmp_path, trial, code, words):
    (tmp_path / "empty.csv").touch()
    files = {"missing": tmp_path / "no.csv", "empty": tmp_path / "empty.csv", "short": record(0.5)}
    done = run("mount", SMALL, "--torque", "4", "h0=20", trial.format(**files))
    assert (done.returncode, done.stdout) == (code, "")
    assert words in " ".join(done.stderr.split())


@pytest.fixture(scope="module")
def cloud():
    return hole_samples(told(), (1.0,), SETUP, **COARSE)


@pytest.mark.thorough
def test_a_value_counts_by_its_own_noise(cloud):
    rough, near = Trial(0.0, 30.0), Trial(0.0, 30.0, noise_arcsec=0.2)
    spread = [posterior_of(cloud, [each], [0.0]).F_ior_arcsec.std() for each in (rough, near)]
    assert spread[1] < 0.9 * spread[0]
    assert np.array_equal(  # the same numbers, whoever gives them
        posterior_of(cloud, [replace(rough, noise_arcsec=2.0)], [0.0]).F_ior_arcsec,
        posterior_of(cloud, [rough], [0.0]).F_ior_arcsec,
    )
    wide, narrow = (
        advise_after(
            cloud.drive, [near], SETUP, outcome=Trial(120.0, 20.0, noise_arcsec=noise), samples=cloud
        ).verification
        for noise in (9.0, 0.1)
    )
    assert wide and narrow
    assert narrow.high_arcsec - narrow.low_arcsec < wide.high_arcsec - wide.low_arcsec


@pytest.mark.thorough
def test_preset_trial_counts_once_even_if_given_again(cloud):
    one = "measured.F_ior={h4@4: 20 ± 1}"
    given, again = [Trial(0.0, 30.0)], Trial(120.0, 20.0)

    def trials_of(*tried):
        return advise_after(told(one), tried, SETUP, samples=cloud).trials

    assert trials_of(*given) == (*given, Trial(120.0, 20.0, M_g=4.0, noise_arcsec=0.5))
    assert trials_of(*given, again) == (*given, again)
    assert len(trials_of(*given, replace(again, F_ior_arcsec=21.0))) == 3
    assert trials_of(*given, replace(again, M_g=4.0)) == (*given, replace(again, M_g=4.0))
    assert len(trials_of(*given, replace(again, M_g=1.0))) == 3  # at another torque it is another value
    assert hole_samples(told(one), (1.0,), SETUP, **COARSE).weight == pytest.approx(cloud.weight)


@pytest.mark.thorough
def test_preset_values_and_trials_give_equal_decisions_at_any_torque(cloud):
    """F'_ior in holes at two torques, as `measured.F_ior` and as trials: the same decision, and far from none."""
    preset = told("measured.F_ior={h0@4: 30 ± 1, h0@1: 90 ± 1, h4@1: 40 ± 1}", "operation.M_g=[1, 4]")
    values = ((0.0, 30.0, 4.0), (0.0, 90.0, 1.0), (120.0, 40.0, 1.0))
    given = [Trial(turn, F_ior, M_g=M_g, noise_arcsec=0.5) for turn, F_ior, M_g in values]
    own, line = (advise_after(each, tried, SETUP, samples=cloud) for each, tried in ((preset, ()), (preset, given)))
    bare = advise_after(told("operation.M_g=[1, 4]"), given, SETUP, samples=cloud)
    for advice in (line, bare):
        assert np.array_equal(advice.decision.F_ior_arcsec, own.decision.F_ior_arcsec)
    at_one = own.decision.F_ior_arcsec[0].mean(axis=0)
    assert at_one[0] == pytest.approx(90, rel=0.1) and at_one[4] == pytest.approx(40, rel=0.1)


@pytest.mark.usefixtures("short_chains")
def test_a_record_has_the_torque_in_its_name(record):
    found = read_trial_or_record(f"h4@1={record(CYCLE)}", load_preset(SMALL), Reading(), 10.0)
    assert (found.rotation_deg, found.M_g) == (120, 1.0)
