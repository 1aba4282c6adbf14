"""Stations along the face: the law of a coned flank, and what becomes of it in the contact system."""

import numpy as np
import pytest

from hdassist.drive.model.contacts import contact_system
from hdassist.drive.model.geometry import Face
from tests.helpers.support import changed, compliance, rounding, solve_state

FLAT = 1e9  # mm, length of a shell that does not cone


def coned(drive, stations, **fields):
    return changed(drive, numerics__stations=stations, **fields)


@pytest.mark.parametrize("stations", [2, 3, 4, 7])
def test_a_flank_meets_the_law_of_a_wedge_on_springs(reference, stations):
    # F = k' d^2/(2 gamma), d the approach at the open edge; strips give it where one of them is in full contact
    slope = 0.96 * np.sin(np.radians(24)) / (160 - 16)  # of the normal distance, along the face
    face = Face.of(coned(reference, stations, contact__k_face=10.0))
    widths = 1 / (10e3 * face.compliance)
    assert widths.sum() == pytest.approx(32)
    assert widths[1:] / widths[:-1] == pytest.approx(14 ** (1 / stations))
    for full in np.cumsum(widths):
        approach = slope * full
        pushed = np.maximum(approach - face.fall * 0.96 * np.sin(np.radians(24)), 0)
        assert (pushed / face.compliance).sum() == pytest.approx(10e3 * approach**2 / (2 * slope), rel=1e-12)


def test_one_station_is_the_whole_flank(reference):
    face = Face.of(changed(reference, contact__k_face=5.0))
    assert face.fall.tolist() == [0.0]
    assert face.compliance.tolist() == [reference.contact.c_t]


def test_stations_stand_off_by_what_the_wave_has_fallen(reference):
    whole, system = contact_system(reference), contact_system(coned(reference, 3))
    here, there = whole.flanks, system.flanks
    for name in ("tooth", "zone", "side", "theta", "alpha", "h_c"):
        assert np.array_equal(getattr(there, name), np.repeat(getattr(here, name), 3))  # copies
    off = (system.delta_p[: system.n_flanks] - whole.delta_p[: whole.n_flanks].repeat(3)).reshape(-1, 3)
    edges = 32 * (14 ** (np.arange(4) / 3) - 1) / 13  # each strip wider than the one before by the cube root of 14
    middles = (edges[1:] + edges[:-1]) / 2
    on_axis = here.theta == 0
    slope = 0.96 * np.sin(here.alpha[on_axis]) / 144
    assert off[on_axis] == pytest.approx(np.outer(slope, middles), rel=1e-12)
    # on the way to the axis a flank slides against its space as well, which tilts one side more, the other less
    before = (here.side == 1) & (here.tooth == -3)
    after = (here.side == 1) & (here.tooth == 3)
    assert off[before][0, 1] > 1.1 * off[on_axis][0, 1]
    assert off[after][0, 1] < 0.9 * off[on_axis][0, 1]
    # beyond the flanks nothing changes: the same functions of the same numbers
    assert np.array_equal(system.delta_p[system.n_flanks :], whole.delta_p[whole.n_flanks :])


def test_flanks_that_do_not_cone_are_whole_flanks(reference):
    # strips side by side are one pair of the same compliance
    long = changed(reference, flexspline__l=FLAT)
    strips = coned(long, 4, contact__k_face=1e-3 / (reference.contact.c_t * 32))
    scalars = np.array([0.03, 0.02, 0.04, -0.03])
    found = []
    for drive in (long, strips):
        system = contact_system(drive)
        forces, _, rotation = solve_state(system, 80e3, system.delta_p + system.deviation_map[:, :4] @ scalars)
        found.append((system.at_places(forces[None])[0, : system.pairs], forces[system.balls], rotation))
    (one, balls, turn), (many, same, again) = found
    assert again == pytest.approx(turn, abs=1e-6)
    assert many == pytest.approx(one, abs=1e-5 * one.max())
    assert same == pytest.approx(balls, abs=1e-5 * balls.max())
    assert np.count_nonzero(one) > 4


def test_the_width_in_contact_grows_with_the_load(reference):
    system = contact_system(coned(reference, 8))
    loaded = []
    for torque in (5e3, 80e3, 800e3):
        forces, _, _ = solve_state(system, torque, system.delta_p)
        bears = forces[: system.n_flanks].reshape(-1, 8) > 1e-6 * forces.max()
        # from the open edge inwards, without a hole
        assert not np.any(bears[:, 1:] & ~bears[:, :-1])
        loaded.append(int(bears.sum(axis=1).max()))
    assert loaded == sorted(loaded)
    assert loaded[0] < loaded[-1] < 8


def test_positive_definite_and_reciprocal(reference):
    system = contact_system(coned(reference, 4))
    held = system.supported
    H = compliance(system) + (system.G[:, held] / system.C[held]) @ system.G[:, held].T
    D = compliance(system)
    assert np.abs(D - D.T).max() <= rounding(2 * reference.numerics.n_max, D.max())
    assert np.linalg.eigvalsh(H)[0] >= 0.999 * reference.contact.c_bore
