"""What an unknown ovality could do to an advice: to first order, by search, and against expected figures."""

import numpy as np
import pytest

from hdassist.error.search import CycleSearch
from hdassist.model.deviations import deviation_scalars
from hdassist.mounting.curve import mounting_curve
from hdassist.mounting.ovality import _grid, _turning, unknown_ovality
from hdassist.mounting.positions import rotated, seat_positions
from tests.support import changed


@pytest.fixture(scope="module")
def curve(reference):
    return mounting_curve(reference, (80.0,), seat_positions(reference), search_from=0, cross_check=None)


def test_three_micrometres_take_most_of_what_turning_brings(reference, curve):
    oval = unknown_ovality(reference, curve, curve.recommended)
    assert oval is not None
    assert (oval.field, oval.amplitude_um) == ("harmonics.a_b2", pytest.approx(3.0))
    # 2.1 falls to 1.3 to 1.7, and the advice loses up to 7 %: computed apart from the tool
    assert oval.without[0] == pytest.approx(2.1, abs=0.15)
    assert (oval.low[0], oval.high[0]) == (pytest.approx(1.3, abs=0.05), pytest.approx(1.7, abs=0.05))
    assert oval.loss == pytest.approx(0.07, abs=0.01)


@pytest.mark.parametrize("fixed", ["rigid", "flexspline"])
def test_to_first_order_an_ovality_turns_the_output(reference, fixed):
    drive = changed(reference, mounting__fixed=fixed)
    name = "b" if fixed == "rigid" else "g"
    oval = changed(drive, **{f"harmonics__a_{name}2": 3.0, f"harmonics__xi_{name}2": 30.0})
    (round_, _), (out, _) = (_grid((each, 80.0, [60.0])) for each in (drive, oval))
    for k, rotation in enumerate((0.0, 60.0)):
        first_order = _turning(drive, 3.0, 30.0 + rotation)
        assert np.std(first_order) > 5
        assert np.std(out[k] - round_[k] - first_order) < 0.5


def test_the_loss_is_that_of_drives_that_are_oval(reference, curve):
    oval = unknown_ovality(reference, curve, curve.recommended)
    assert oval is not None
    hidden = changed(reference, harmonics__a_b2=3.0, harmonics__xi_b2=oval.worst_deg)
    search = CycleSearch(hidden, 80.0)
    found = [search.extremes(rotated(hidden, r)).F_ior_arcsec for r in seat_positions(hidden)]
    advised = found[curve.recommended.hole]
    assert advised / min(found) - 1 == pytest.approx(oval.loss, abs=0.02)
    assert max(found) / min(found) == pytest.approx(np.clip(max(found) / min(found), oval.low, oval.high)[0], rel=0.03)


def test_what_is_known_is_not_assumed(reference, curve):
    for known in ({"harmonics__a_b2": 0.0}, {"tolerances__F_i2": 0.0}, {"bearing__ball_motion": "rolling"}):
        assert unknown_ovality(changed(reference, **known), curve, curve.recommended) is None


def test_a_seats_ovality_stands_still_while_the_wheel_turns(reference):
    alpha = np.linspace(0, 6, 5)
    for name, moves in (("b", True), ("s", False)):
        drive = changed(reference, **{f"harmonics__a_{name}2": 3.0, f"harmonics__xi_{name}2": 20.0})
        here, there = (deviation_scalars(each, alpha, -alpha)[:, 6:8] for each in (drive, rotated(drive, 30.0)))
        assert np.allclose(here, there) != moves
