"""Every preset field moves an answer: which way, and at least how much.

The sizes are about half of what was seen; the signs are physics, each with its reason.
"""

import re
from pathlib import Path

import numpy as np
import pytest

from hdassist import kinematic_error
from hdassist.drive.error.cycle import KinematicError, SelfError, self_error
from hdassist.drive.model.contacts import contact_system
from hdassist.drive.model.geometry import Geometry, Kinematics, ball_phase, pitch_locked_states
from hdassist.drive.preset.fields import DEVIATIONS, Acceptance, Drive, field_table
from hdassist.drive.solve.answers import EMPTY
from hdassist.features.acceptance.decision import AcceptedValue
from hdassist.features.acceptance.limits import limits_of
from hdassist.features.design import DesignCheck, OperatingPoint
from hdassist.features.mounting.positions import MountingCurve, seat_positions
from hdassist.run.errors import Verdict
from hdassist.run.run import UNCHECKED
from tests.helpers.acceptances import accept
from tests.helpers.support import changed, solve_state, wind_up


def light(drive: Drive) -> float:
    """Wind-up without deviations at 80 N*m [arcsec]."""
    return wind_up(drive, 80)


def heavy(drive: Drive) -> float:
    """Wind-up without deviations at 800 N*m [arcsec]."""
    return wind_up(drive, 800)


def gap(drive: Drive) -> float:
    """Least nominal gap of the flanks [um]."""
    return float(contact_system(drive).flanks.gap.min()) * 1e3


def on_balls(drive: Drive) -> float:
    """Sum of the forces on the balls at 80 N*m without deviations [N]."""
    system = contact_system(drive)
    return float(solve_state(system, 80e3, system.delta_p)[0][system.balls].sum())


def turn(drive: Drive) -> KinematicError:
    states = pitch_locked_states(Kinematics.of(drive), np.arange(0, 404, 2), 0.3)
    return kinematic_error(drive, 80, states=states, run=UNCHECKED)


def error(drive: Drive) -> float:
    """Range of the error over two cam turns at 80 N*m [arcsec]."""
    return turn(drive).range_arcsec


def twist(drive: Drive) -> float:
    """Mean twist with deviations over two cam turns at 80 N*m [arcsec]."""
    return turn(drive).wind_up_arcsec


MOVES = [
    ("gears.m", 0.801, on_balls, -5, "the same torque on a longer arm needs less force"),
    ("gears.alpha", 20.5, heavy, +1.5, "a steeper flank yields more to a given torque"),
    ("gears.x_g", 3.11, gap, -1.4, "thicker teeth"),
    ("gears.x_b", 3.31, gap, +1.4, "wider spaces"),
    ("gears.x_g", 3.11, twist, -2.5, "less clearance to take up"),
    ("gears.x_b", 3.31, twist, +2.9, "more clearance to take up"),
    ("gears.h_a", 0.58, light, +0.03, "shorter teeth meet later"),
    ("gears.h_f", 1.30, heavy, -0.02, "a larger rim lies nearer to the contacts"),
    ("gears.j_n", 8.0, light, +1.3, "a micrometre on a flank is 206265/(82.5 cos 24.5 deg) = 2.75 arcsec"),
    ("material.E", 2.10e5, heavy, -0.3, "stiffer rings"),
    ("material.nu", 0.33, heavy, -0.03, "D grows with nu"),
    ("flexspline.h_1", 1.5, heavy, -0.8, "stiffer rim"),
    ("flexspline.h_3", 1.6, heavy, -0.9, "stiffer shell"),
    ("flexspline.b_w", 34.0, heavy, -0.5, "wider rim"),
    ("flexspline.l", 170.0, heavy, -0.1, "a longer shell bends with the rim: D L/3"),
    ("flexspline.k_t", 1.5, heavy, -0.1, "stiffer rim"),
    ("bearing.N", 23, heavy, +1.3, "fewer balls"),
    ("bearing.ring_b", 26.0, on_balls, +90, "a stiffer ring takes more force to be bent to the cam"),
    ("bearing.ring_h", 4.2, on_balls, +170, "stiffness of a ring goes with the cube of its thickness"),
    ("bearing.g_b", 3.0, light, +1.9, "a smaller wave: teeth come in less deep"),
    ("bearing.beta", 0.5, heavy, -0.6, "no ball under the major axis, two beside it"),
    ("cam.W_0", 0.955, gap, +1.1, "teeth come in less deep"),
    ("cam.W_0", 0.955, twist, +2.3, "more clearance to take up"),
    ("supports.C_1", 2e5, error, -0.8, "a softer seat follows the deviations"),
    ("supports.C_2", 3e4, error, +0.9, "a stiffer flexspline support resists the deviations"),
    ("supports.C_3", 1.2e4, error, +1.8, "a stiffer shaft resists the deviations"),
    ("contact.c_t", 2.5e-5, heavy, +2.8, "softer teeth"),
    ("contact.c_ball", 3e-5, heavy, +6.9, "softer balls"),
    ("contact.c_bore", 5e-6, heavy, +2.4, "softer seat of the ring"),
    ("tolerances.F_i1", 40.0, error, -0.5, "a better flexspline"),
    ("tolerances.F_i2", 40.0, error, -2.0, "a better circular spline"),
    ("tolerances.e_hb", 40.0, error, -0.3, "a better seat of the cam"),
    ("tolerances.e_hh", 0.0, error, -1.7, "a cam that runs true"),
    ("tolerances.e_hg", 30.0, error, +0.3, "one offset more"),
    ("phases.xi_g", 90.0, error, +3.8, "vectors stand otherwise; seen"),
    ("phases.xi_b", 80.0, error, -8.6, "opposite to the worst phase; seen"),
    ("phases.phi_hb", 90.0, error, -5.5, "as xi_b turned back by 90 deg; seen"),
    ("phases.phi_hh", 90.0, error, -0.4, "vectors stand otherwise; seen"),
    ("operation.dT", 10.0, heavy, -7, "a warm flexspline closes its flanks by 3.9 um"),
    ("operation.dT", 1.0, heavy, -0.7, "a tenth of it"),
    ("numerics.n_max", 20, heavy, -0.5, "fewer modes, less compliance"),
    ("numerics.n_2", 50, light, +0.25, "a seat on fewer nodes yields between them"),
]
PITCH = [each for each in DEVIATIONS if each.kind == "pitch"]
LIMITS = [
    path
    for path, field in field_table().items()
    if path.startswith("acceptance.")
    if field.kind in ("limits", "orders") or field.is_optional
]


def marked() -> set[str]:
    """Fields that a test somewhere moves on its own: it bears @pytest.mark.moves("section.field", ...)."""
    texts = (file.read_text(encoding="utf-8") for file in Path(__file__).parents[1].rglob("test_*.py"))
    marks = [mark for text in texts for mark in re.findall(r"^@pytest\.mark\.moves\(([^)]*)\)", text, re.MULTILINE)]
    return {path for mark in marks for path in re.findall(r"\w+\.\w+", mark)}


def test_no_field_is_left_out():
    of_pitch = {path for each in PITCH for path in (each.size, each.direction)}
    assert {path for path, *_ in MOVES} | {*LIMITS} | marked() | of_pitch == set(field_table())


@pytest.mark.parametrize(
    ("path", "value", "measure", "least", "why"), MOVES, ids=lambda x: getattr(x, "__name__", str(x))
)
def test_field_moves_the_answer(reference, path, value, measure, least, why):
    moved = measure(changed(reference, **{path.replace(".", "__"): value})) - measure(reference)
    assert moved * np.sign(least) >= abs(least), why


@pytest.mark.moves("gears.z_g", "gears.z_b")
def test_teeth_set_size_and_ratio(reference):
    more = changed(reference, gears__z_g=202, gears__z_b=204)
    assert Kinematics.of(more).u == Kinematics.of(reference).u - 1
    # two teeth more: the circles grow by one module
    assert Geometry.of(more).r_m - Geometry.of(reference).r_m == pytest.approx(0.8)
    assert Geometry.of(more).r_ab - Geometry.of(reference).r_ab == pytest.approx(0.8)
    assert len(pitch_locked_states(Kinematics.of(more))) == 202 * 102


def test_clearance_is_felt_as_the_geometry_says(reference):
    # all contacts between the wheels open alike: turn = j_n/(arm cos alpha)
    system = contact_system(reference)
    forces, _, _ = solve_state(system, 80e3, system.delta_p)
    flank = forces[: system.n_flanks]
    share = flank @ system.lever.sum(axis=1) / flank.sum()
    assert light(changed(reference, gears__j_n=8.0)) - light(reference) == pytest.approx(
        1e-3 / share * 206264.8, rel=0.02
    )


@pytest.mark.moves("material.alpha_T")
def test_expansion_matters_if_parts_differ_in_temperature(reference):
    steel, twice = (changed(reference, operation__dT=dT) for dT in (10.0, 20.0))
    # half the growth at twice the difference of temperatures is the same drive
    assert heavy(changed(twice, material__alpha_T=11.5e-6 / 2)) == pytest.approx(heavy(steel), abs=1e-9)
    assert heavy(changed(steel, material__alpha_T=23e-6)) < heavy(steel) - 5
    assert heavy(changed(reference, material__alpha_T=23e-6)) == heavy(reference)  # times 0


@pytest.mark.moves("bearing.d_ball")
def test_ball_diameter_sets_the_cage(reference):
    rolling = changed(reference, bearing__ball_motion="rolling")
    turn = np.array([0.1])
    slow = ball_phase(changed(rolling, bearing__d_ball=10.0), turn) - ball_phase(rolling, turn)
    # larger balls: smaller inner raceway, the cage falls further behind the cam
    assert float(slow[0]) > 0.005


@pytest.mark.moves("numerics.nominal_curve")
def test_the_nominal_curve_moves_the_teeth(reference):
    # some micrometres at the flanks, a few arcsec of twist at a light load
    other = changed(reference, numerics__nominal_curve="inextensible")
    assert 0.5 < abs(twist(other) - twist(reference)) < 6


@pytest.mark.moves("numerics.stations")
def test_coned_flanks_bear_beside_the_edge(reference):
    # a pair that bears on a few millimetres yields more at first, and hardly more once the width has grown
    coned = changed(reference, numerics__stations=4)
    assert light(coned) - light(reference) > 9
    assert heavy(coned) - light(coned) - (heavy(reference) - light(reference)) < 7
    assert contact_system(coned).n_flanks == 4 * contact_system(reference).n_flanks


@pytest.mark.moves("contact.k_face")
def test_a_stiffer_face_twists_less_where_flanks_are_coned(reference):
    coned = changed(reference, numerics__stations=4)
    soft, stiff = (changed(coned, contact__k_face=k) for k in (6.8, 10.0))
    assert light(soft) - light(stiff) > 2.8
    assert heavy(soft) - heavy(stiff) > 4
    # it takes the place of c_t, and the other way round: a number that is not read
    assert heavy(changed(coned, contact__c_t=4e-5)) == heavy(coned)
    assert heavy(changed(reference, contact__k_face=6.8)) == heavy(reference)


@pytest.mark.moves("bearing.ball_motion")
def test_rolling_balls_add_error(reference):
    assert error(changed(reference, bearing__ball_motion="rolling")) - error(reference) > 0.09


@pytest.mark.moves("numerics.n_beta")
@pytest.mark.slow
def test_ball_positions_converge(reference):
    rolling = changed(reference, bearing__ball_motion="rolling")
    traces = [turn(changed(rolling, numerics__n_beta=n)).error_arcsec for n in (4, 48, 192)]
    coarse, fine = (float(np.abs(t - traces[-1]).max()) for t in traces[:2])
    assert coarse > 0.1
    assert fine < coarse / 4


@pytest.mark.moves("phases.phi_hg")
def test_direction_of_the_offset_that_goes_with_the_flexspline(reference):
    drive = changed(reference, tolerances__e_hg=60.0)
    assert abs(error(changed(drive, phases__phi_hg=180.0)) - error(drive)) > 0.5


@pytest.mark.moves("mounting.fixed")
def test_fixed_wheel_reverses_the_error(reference):
    other = changed(reference, mounting__fixed="flexspline")
    assert Kinematics.of(other).u == 101
    rows = np.arange(100)
    one, two = (
        kinematic_error(d, 80, states=pitch_locked_states(Kinematics.of(d), rows), run=UNCHECKED)
        for d in (reference, other)
    )
    assert two.error_arcsec == pytest.approx(-one.error_arcsec, abs=1e-7)
    assert one.range_arcsec > 5


@pytest.mark.moves("mounting.mark_kind")
def test_marks_are_no_phases(reference):
    # turning both marks by what their kind means gives the same drive
    marked = changed(reference, mounting__mark_kind="pitch", phases__xi_b=350.0, phases__xi_g=90.0)
    assert error(marked) == pytest.approx(error(reference), abs=1e-7)
    for kind in ("pitch", "runout"):
        assert abs(error(changed(reference, mounting__mark_kind=kind)) - error(reference)) > 1


@pytest.mark.moves("tolerances.e_b", "phases.phi_eb")
def test_a_run_out_is_more_than_its_tangential_part(reference):
    run_out = {"tolerances__F_i2": 0.0, "tolerances__e_b": 37.5}
    found = [error(changed(reference, **run_out, phases__phi_eb=mark)) for mark in (80.0, 260.0)]
    assert abs(found[1] - found[0]) > 4
    # xi = 260 deg has the tangential part of a mark at 80 deg
    assert abs(found[0] - error(reference)) > 1


# wheel, order, its size [um], and between what the greater of two changes of F'_ior lies [arcsec]
EVEN = [(wheel, order, 2.0, 3.0, 20.0) for wheel, order in (("g", 2), ("g", 4), ("b", 2), ("b", 4), ("s", 2))]
ODD = [(wheel, 3, 6.0, 0.01, 3.0) for wheel in "gb"]


@pytest.mark.moves(
    "harmonics.a_g2", "harmonics.a_g3", "harmonics.a_g4", "harmonics.a_b2", "harmonics.a_b3", "harmonics.a_b4",
    "harmonics.a_s2", "harmonics.xi_g2", "harmonics.xi_g3", "harmonics.xi_g4", "harmonics.xi_b2", "harmonics.xi_b3",
    "harmonics.xi_b4", "harmonics.xi_s2",
)  # fmt: skip
@pytest.mark.parametrize(("wheel", "order", "um", "least", "most"), [*EVEN, *ODD])
def test_even_harmonics_change_the_error_and_odd_ones_nearly_cancel(reference, wheel, order, um, least, most):
    size, phase = f"harmonics__a_{wheel}{order}", f"harmonics__xi_{wheel}{order}"
    found = [error(changed(reference, **{size: um, phase: at})) - error(reference) for at in (0.0, 180 / order)]
    assert least < max(map(abs, found)) < most
    assert abs(found[1] - found[0]) > 0.01


@pytest.mark.parametrize("moved", PITCH, ids=lambda each: each.direction)
def test_single_pitch_deviation_changes_the_error_in_all_its_orders(reference, moved):
    rough = reference.with_values({moved.size: 20.0})
    turned = rough.with_values({moved.direction: 180.0 / moved.order})
    assert 0.5 < error(rough) - error(reference) < 20
    assert abs(error(turned) - error(rough)) > 0.01


@pytest.mark.moves("numerics.n_phase")
def test_more_phases_find_more_of_the_self_error(reference):
    coarse, fine = (self_error(changed(reference, numerics__n_phase=n), [80.0])[0] for n in (2, 6))
    assert fine.certificate.states == 36
    assert fine.range_arcsec > coarse.range_arcsec + 0.1


@pytest.mark.moves("mounting.holes")
@pytest.mark.parametrize(("holes", "hole"), [(12, 5), (36, 15), (8, None), (0, None)])
def test_holes_number_the_positions(reference, holes, hole):
    assert len(seat_positions(changed(reference, mounting__holes=holes))) == (holes or 72)
    rotations = np.array([0.0, 150.0])
    every = np.ones((1, 2), dtype=bool)
    curve = MountingCurve((80.0,), rotations, rotations, np.array([[2.0, 1.0]]), EMPTY, (), every, holes=holes)
    assert curve.at(1).hole == hole
    assert (curve.recommended == curve.at(1)) == (hole is not None or holes == 0)


def point(drive: Drive, M_g: float, F_ior: float, self_error: float) -> OperatingPoint:
    states = pitch_locked_states(Kinematics.of(drive))
    rotation = np.zeros(len(states))
    rotation[7] = F_ior
    kinematics = Kinematics.of(drive)
    result = KinematicError(kinematics, M_g, states, rotation, np.ones((len(states), 2)), rotation, EMPTY, None)
    own = SelfError(M_g, np.array([[0.0, self_error]]), EMPTY)
    return OperatingPoint(M_g, own, drive.limit(M_g), error=result)


@pytest.mark.parametrize(
    ("limits", "verdicts"),
    [
        ({}, ["NO_LIMIT", "NO_LIMIT"]),
        ({"all": 29.5}, ["PASS", "PASS"]),
        ({"all": 28.5}, ["FAIL", "PASS"]),  # 28 arcsec are within, 28 + 1 are not
        ({"80": 28.5}, ["FAIL", "NO_LIMIT"]),
        ({"80": 29.0, "all": 5.0}, ["PASS", "FAIL"]),
    ],
)
def test_limits_and_torques_set_the_verdict(reference, limits, verdicts):
    drive = changed(reference, acceptance__F_ior=limits)
    report = DesignCheck(drive, (point(drive, 80.0, 28.0, 1.0), point(drive, 800.0, 8.0, 2.0)))
    assert [p.verdict for p in report.points] == verdicts
    assert report.verdict == (Verdict.FAIL if "FAIL" in verdicts else verdicts[0])


@pytest.mark.moves("operation.rated")
def test_rated_torque_warns(reference):
    drive = changed(reference, operation__rated=500.0)
    points = (point(drive, 80.0, 1.0, 1.0), point(drive, 800.0, 1.0, 1.0))
    assert DesignCheck(drive, points).warnings == ("800 N*m is above the rated torque of 500 N*m",)
    assert DesignCheck(reference, points).warnings == ()


def with_acceptance(drive: Drive, **values: object) -> Drive:
    return drive.model_copy(update={"acceptance": Acceptance(**values)})


@pytest.mark.parametrize("path", LIMITS)
def test_each_limit_decides(reference, path):
    kind, name = field_table()[path].kind, path.split(".")[1]
    drive = with_acceptance(reference, **{name: {"limits": {"80": 20.0}, "orders": {"2": 20.0}}.get(kind, 20.0)})
    limit = limits_of(drive)[0]
    values = (AcceptedValue(number, 0.0, "stated", "whole") for number in (19.0, 21.0))
    verdicts = [accept(drive, stated={limit: value}, measured_only=True).verdict for value in values]
    assert verdicts == (["PASS", "FAIL"] if limit.check.upper else ["FAIL", "PASS"])


@pytest.mark.moves("operation.M_g")
def test_limits_hold_at_each_torque(reference):
    drive = with_acceptance(changed(reference, operation__M_g=(40.0, -70.0)), F_ior={"all": 30.0})
    assert [limit.M_g_Nm for limit in limits_of(drive)] == [40, -70]
    assert wind_up(reference, 40) < wind_up(reference, 70)


@pytest.mark.moves("acceptance.rule")
def test_rule_of_measured_values(reference):
    def verdict(rule: str) -> Verdict:
        drive = with_acceptance(reference, lost_motion=60.0, rule=rule)
        return accept(
            drive, stated=dict.fromkeys(limits_of(drive), AcceptedValue(59.0, 2.0, "stated", "whole"))
        ).verdict

    assert [verdict(rule) for rule in ("simple", "guard")] == ["PASS", "INCONCLUSIVE"]


@pytest.mark.moves("mounting.allowed")
def test_holes_that_are_not_allowed_are_no_positions(reference):
    assert seat_positions(changed(reference, mounting__allowed=(2, 5))) == [0, 60, 150]
