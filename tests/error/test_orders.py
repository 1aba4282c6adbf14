"""Orders of the error: amplitudes, phases and causes."""

import numpy as np
import pytest

from hdassist import trace
from hdassist.drive.error.waves import NO_CAUSE, known_causes, order_legend, orders
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed


@pytest.fixture(scope="module")
def cycle(reference):
    """The full cycle of the reference drive at 80 N*m."""
    return trace(reference, 80, revolutions=100, run=UNCHECKED)


def test_a_known_wave_is_found(reference):
    turns, per_turn = 100, 202
    phi = 2 * np.pi * np.arange(turns * per_turn) / per_turn
    error = 3.0 * np.cos(2.01 * phi + np.radians(40)) + 1.0 * np.cos(0.01 * phi - np.radians(90)) + 5.0
    found = {o.per_cam_rev: o for o in orders(reference, error, turns) if o.amplitude_arcsec > 1e-6}
    assert set(found) == {2.01, 0.01}
    assert found[2.01].amplitude_arcsec == pytest.approx(3)
    assert found[2.01].phase_deg == pytest.approx(40)
    assert found[2.01].cause == "flexspline + circular spline"
    assert found[0.01].amplitude_arcsec == pytest.approx(1)
    assert found[0.01].phase_deg == pytest.approx(-90)
    assert found[0.01].cause == "flexspline - circular spline"


def test_orders_add_up_to_the_error(reference):
    result = trace(reference, 80, revolutions=1, run=UNCHECKED)
    phi = result.error.states.phi_h
    every = orders(reference, result.error.error_arcsec, 1)
    assert every == list(result.orders)
    spectrum = np.fft.rfft(result.error.error_arcsec)
    largest = max(result.orders, key=lambda o: o.amplitude_arcsec)
    k = round(largest.per_cam_rev)
    assert largest.amplitude_arcsec == pytest.approx(2 * abs(spectrum[k]) / 202)
    wave = largest.amplitude_arcsec * np.cos(k * phi + np.radians(largest.phase_deg))
    rest = result.error.error_arcsec - wave
    assert abs(np.fft.rfft(rest)[k]) < 1e-9


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("quiet", "order"),
    [
        ({"tolerances__e_hh": 0.0}, 1.00),  # odd orders need the offset that turns with the cam
        ({"tolerances__F_i1": 0.0}, 2.01),  # no flexspline, no beat with it
        ({"tolerances__F_i1": 0.0}, 2.02),
        ({"tolerances__F_i2": 0.0, "tolerances__e_hb": 0.0}, 2.00),
    ],
)
def test_a_cause_taken_away_takes_its_order_along(reference, cycle, quiet, order):
    def amplitude(result) -> float:
        return next((o.amplitude_arcsec for o in result.orders if abs(o.per_cam_rev - order) < 1e-9), 0.0)

    assert amplitude(cycle) > 0.5
    assert amplitude(trace(changed(reference, **quiet), 80, revolutions=100, run=UNCHECKED)) < 1e-6


def test_most_of_the_error_has_a_known_cause(cycle):
    power = {True: 0.0, False: 0.0}
    for order in cycle.orders:
        power[order.cause == NO_CAUSE] += order.amplitude_arcsec**2
    assert power[False] > 0.98 * np.var(cycle.error.error_arcsec) * 2


def test_causes_follow_what_is_there(reference):
    assert (0, 1) in known_causes(reference)
    assert (0, 1) not in known_causes(changed(reference, tolerances__e_hh=0.0))
    quiet = changed(reference, tolerances__F_i1=0.0)
    assert all(k_g == 0 for k_g, _ in known_causes(quiet))
    assert (1, 0) in known_causes(changed(quiet, tolerances__e_hg=1.0))


@pytest.mark.parametrize("odd", [{"bearing__N": 23}, {"gears__z_g": 199, "gears__z_b": 201}])
def test_odd_orders_need_no_eccentricity_for_odd_numbers_of_parts(reference, odd):
    drive = changed(reference, tolerances__e_hh=0.0, **odd)
    once = [o for o in trace(drive, 800, revolutions=100, run=UNCHECKED).orders if abs(o.per_cam_rev - 1) < 0.02]
    assert max(o.amplitude_arcsec for o in once) > 0.01
    assert {o.cause for o in once} >= {"circular spline", "flexspline"}
    assert "even number" not in order_legend(drive)
    assert "even number" in order_legend(reference)


def test_orders_of_the_other_mounting(reference):
    order, words = known_causes(changed(reference, mounting__fixed="flexspline"))[1, 1]
    assert order == pytest.approx(1 + 200 / 202)
    assert words == "flexspline + circular spline"


@pytest.mark.parametrize("revolutions", [0, 101])
def test_a_trace_is_one_turn_to_a_cycle(reference, revolutions):
    with pytest.raises(UsageError, match="1 to 100"):
        trace(reference, 80, revolutions=revolutions)


@pytest.mark.parametrize("count", [200, 201])
def test_highest_order_is_correct_for_even_and_odd_state_counts(reference, count):
    # with an even number it stands alone at the end of the spectrum, with an odd one it has a mirror image
    error = 1.5 * np.cos(100 * 2 * np.pi * np.arange(count) / count)
    assert {o.per_cam_rev: o.amplitude_arcsec for o in orders(reference, error, 1)}[100] == pytest.approx(1.5)


def test_a_trace_starts_at_an_angle(reference):
    with pytest.raises(UsageError, match="invalid start angle nan: expected a finite number"):
        trace(reference, 80, start_deg=np.nan)
