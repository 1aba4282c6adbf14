"""The error of a drawn drive over its cycle, read off waves, against every state."""

import numpy as np
import pytest

from hdassist import kinematic_error, load_preset
from hdassist.drive.error.waves import estimated_cycle, turn_range_arcsec
from hdassist.run.run import UNCHECKED
from tests.helpers.process import SMALL


def test_estimated_cycle_has_exact_range_and_orders_from_fewer_states():
    drive = load_preset("vzp160")
    exact, found = kinematic_error(drive, 80.0, run=UNCHECKED), estimated_cycle(drive, 80.0)
    assert np.ptp(found.error_arcsec) == pytest.approx(exact.range_arcsec, rel=0.01)
    spectra = [np.abs(np.fft.rfft(each))[1:1201] / len(each) for each in (found.error_arcsec, exact.error_arcsec)]
    assert spectra[0] == pytest.approx(spectra[1], abs=0.01)  # arcsec, up to order 12
    assert turn_range_arcsec(found) == pytest.approx(turn_range_arcsec(exact), rel=1e-3)
    assert found.certificate.states < exact.certificate.states / 10


def test_estimate_solves_the_worst_revolution_if_flanks_separate():
    drive = load_preset("size-25-100", ["operation.M_g=3"])  # a light load: the waves alone are 5 % off
    sets = {
        "tolerances.e_hb": 60.0,
        "phases.phi_hb": 40.0,
        "tolerances.F_i1": 30.0,
        "phases.xi_g": 10.0,
        "phases.xi_b": 80.0,
    }
    exact, found = (
        kinematic_error(drive.with_values(sets), 3.0, run=UNCHECKED),
        estimated_cycle(drive.with_values(sets), 3.0),
    )
    assert turn_range_arcsec(found) <= turn_range_arcsec(exact) + 1e-9
    assert turn_range_arcsec(found) == pytest.approx(turn_range_arcsec(exact), rel=0.015)


def test_of_a_short_cycle_every_state_is_solved():
    drive = load_preset(SMALL)
    exact = kinematic_error(drive, 4.0, run=UNCHECKED).error_arcsec
    assert estimated_cycle(drive, 4.0).error_arcsec == pytest.approx(exact, abs=1e-9)
