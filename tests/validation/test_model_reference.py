"""Reference numbers of the model on the frozen reference preset.

Made once by two independent implementations of the model's equations; met here to 0.2 %. They prove
that the equations were written down right, not that the drive behaves so.
"""

from functools import cache

import numpy as np
import pytest

from hdassist.drive.error.cycle import kinematic_error, self_error
from hdassist.drive.error.error_map import ErrorMap
from hdassist.drive.error.stiffness import stiffness
from hdassist.drive.model.contacts import contact_system, shell_twist_stiffness
from hdassist.drive.model.deviations import deviation_scalars
from hdassist.drive.model.geometry import Geometry, Kinematics, pitch_locked_states
from hdassist.drive.solve.answers import ARCSEC
from hdassist.run.run import UNCHECKED
from tests.helpers.support import changed, solve_state, wind_up

REL = 0.002  # the reference numbers carry four digits at most


@pytest.fixture(scope="module")
def full_cycle(reference):
    """Full cycles by torque [N*m] and phase xi_b [deg], each computed once."""

    @cache
    def at(M_g, phase):
        return kinematic_error(changed(reference, phases__xi_b=float(phase)), M_g, run=UNCHECKED)

    return at


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("M_g", "phase", "expected", "half_digit"),
    [
        (80, 0, 31.50, 0.005),
        (80, 180, 20.07, 0.005),
        (800, 0, 12.29, 0.005),
        (800, 180, 2.39, 0.005),
    ],
)
def test_full_cycle(full_cycle, M_g, phase, expected, half_digit):
    result = full_cycle(M_g, phase)
    assert result.certificate.states == 20200
    assert result.F_ior_arcsec == pytest.approx(expected, abs=max(REL * expected, half_digit))


@pytest.mark.parametrize(("M_g", "phase", "share"), [(80, 0, 0.51), (80, 180, 0.31), (800, 0, 0.0)])
def test_one_wave_meshing(full_cycle, M_g, phase, share):
    assert full_cycle(M_g, phase).one_wave_share == pytest.approx(share, abs=0.005)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("M_g", "phase", "expected"),
    [
        (80, 330, 32.0),
        (80, 135, 14.2),
        (800, 335, 12.7),
        # noted as "least near 190: 2.2"; that is the value at 185 and 195, between them it falls to 2.03
        (800, 185, 2.2),
        (800, 195, 2.2),
    ],
)
def test_extremes_over_the_phase(reference, M_g, phase, expected):
    drive = changed(reference, phases__xi_b=float(phase))
    assert ErrorMap(drive, M_g).extremes(drive).first == pytest.approx(expected, abs=0.05 + REL * expected)


@pytest.mark.parametrize(("phi_g0", "expected"), [(20, 20.02), (100, 27.24), (300, 8.90)])
def test_one_cam_revolution(reference, phi_g0, expected):
    states = pitch_locked_states(Kinematics.of(reference), np.arange(202), np.radians(phi_g0))
    result = kinematic_error(reference, 80, states=states)
    assert result.range_arcsec == pytest.approx(expected, rel=REL)


def test_one_state(reference):
    system = contact_system(reference)
    assert len(system.delta_p) == 324
    scalars = deviation_scalars(reference, np.radians([20.0 - 90.0]), np.radians([-90.0]))[0]
    forces, _, rotation = solve_state(system, 80e3, system.delta_p + system.deviation_map[:, :4] @ scalars)
    assert rotation == pytest.approx(21.660, rel=REL)
    flanks = forces[: system.n_flanks]
    assert flanks.sum() == pytest.approx(2829.5, rel=REL)
    assert forces[system.balls].sum() == pytest.approx(4080.7, rel=REL)
    moments = (flanks @ system.lever / 1e3).tolist()
    assert moments == pytest.approx([85.55, -5.55], rel=REL)


def test_self_error(reference):
    light, heavy = self_error(changed(reference, numerics__n_phase=10), [80.0, 800.0])
    assert light.range_arcsec == pytest.approx(0.89, abs=0.005)
    assert heavy.range_arcsec == pytest.approx(1.90, abs=0.005)
    assert light.tooth_phase_arcsec == pytest.approx(0.1, abs=0.05)
    assert heavy.tooth_phase_arcsec == pytest.approx(0.4, abs=0.05)
    assert light.ball_phase_arcsec == pytest.approx(0.8, abs=0.05)
    assert heavy.ball_phase_arcsec == pytest.approx(1.6, abs=0.05)


def test_torsional_stiffness(reference):
    light, heavy = wind_up(reference, 80), wind_up(reference, 800)
    assert light == pytest.approx(7.66, abs=0.005)
    assert heavy == pytest.approx(137.83, abs=0.005)
    mesh = 720e3 / ((heavy - light) / ARCSEC)
    tube = shell_twist_stiffness(reference, Geometry.of(reference))
    total = 1 / (1 / mesh + 1 / tube) / 1e3  # N*m/rad
    assert total == pytest.approx(0.76e6, rel=0.01)
    # catalogue: sizes 58 and 65, between which the drive lies
    assert 0.61e6 <= total <= 0.98e6


@pytest.mark.parametrize(
    ("k_face", "j_n", "expected"),
    [(10, 7, (63, 78, 87)), (6.8, 7, (59, 76, 86)), (10, 10, (55, 78, 87)), (6.8, 10, (52, 76, 86))],
)
def test_stiffness_with_coned_flanks(reference, k_face, j_n, expected):
    fields = {"contact__k_face": k_face, "gears__j_n": j_n, "numerics__nominal_curve": "linear"}
    curve = stiffness(changed(reference, numerics__stations=8, **fields), run=UNCHECKED, points=1)
    # noted to 3 %, with the slope on the axis for every flank: that of each is another 1 to 2 %
    assert [segment.stiffness / 1e4 for segment in curve.positive] == pytest.approx(expected, rel=0.04)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"gears__j_n": 6.0}, (30.2, 18.7, 12.9, 2.4)),
        ({"gears__j_n": 8.0}, (34.7, 20.9, 11.7, 2.4)),
        ({"cam__W_0": 0.96 * 0.99}, (42.6, 24.3, 10.0, 2.4)),
        ({"bearing__g_b": 5.0}, (38.4, 20.9, 9.6, 2.5)),
        ({"contact__c_ball": 1 / 60000}, (25.9, 15.8, 14.5, 4.4)),
        ({"bearing__beta": 0.5}, (32.5, 19.3, 12.1, 2.2)),
    ],
)
@pytest.mark.slow
def test_sensitivities(reference, fields, expected):
    got = [
        kinematic_error(changed(reference, phases__xi_b=phase, **fields), M_g, run=UNCHECKED).F_ior_arcsec
        for M_g, phase in ((80, 0.0), (80, 180.0), (800, 0.0), (800, 180.0))
    ]
    # the table was noted from a coarser run, whose unchanged values were 31.4 and 20.0 for 31.50 and 20.07: 2 %
    assert got == pytest.approx(expected, rel=0.02, abs=0.05)
