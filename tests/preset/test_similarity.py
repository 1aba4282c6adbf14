"""Drives like a known one: they mesh, keep its proportions, say what is given, and contradictions are refused."""

from __future__ import annotations

import json
from math import isclose
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hdassist import kinematic_error, load_preset, stiffness
from hdassist.drive.loading import load_text, similar_preset
from hdassist.drive.model.geometry import Kinematics, pitch_locked_states
from hdassist.drive.model.rules import conflicts
from hdassist.drive.preset.fields import Drive, field_table, measures, origin_counts, resolved_fields
from hdassist.drive.preset.knowledge import (
    LAWS,
    PITCH_DIAMETER,
    STIFFNESS,
    F_p,
    SimilarValue,
    read_requirements,
    similar,
)
from hdassist.run.errors import UsageError
from hdassist.run.run import UNCHECKED
from tests.helpers.process import run

LIKE = load_preset("vzp160")


def made(like: Drive = LIKE, **wish: object) -> Drive:
    """A drive like another one: teeth z_g, pitch diameter [mm], torque [N*m], stiffness K1, K2, K3 [N*m/rad]."""
    paths = {"z_g": "gears.z_g", "diameter": PITCH_DIAMETER, "torque": "operation.rated", "stiffness": STIFFNESS}
    required = {paths[name]: SimilarValue(value, "given", "hdassist presets new") for name, value in wish.items()}
    return load_text(similar_preset("own", like, required), "own")


def bore(drive: Drive) -> float:
    """Bore of the flexspline [mm]."""
    g = drive.gears
    return g.m * (g.z_g + 2 * g.x_g - 2 * g.h_f) - 2 * drive.flexspline.h_1


@pytest.mark.thorough
@settings(max_examples=30, deadline=None)
@given(st.floats(20, 400), st.integers(60, 640))
def test_any_size_and_ratio_makes_a_drive_that_meshes(d: float, z_g: int) -> None:
    if not 0.05 <= d / z_g <= 5:  # no preset has such modules
        with pytest.raises(UsageError, match="do not give a valid drive"):
            made(z_g=z_g, diameter=d)
        return
    drive = made(z_g=z_g, diameter=d)
    assert drive.origin.warnings == ()
    assert isclose(drive.gears.m * drive.gears.z_g, d, rel_tol=1e-11)
    assert isclose(bore(drive) / d, bore(LIKE) / 160, rel_tol=2e-5)
    assert isclose(drive.cam.W_0 / drive.gears.m, 1.2, rel_tol=1e-3)


@pytest.mark.parametrize("z_g", [60, 100, 200, 320])
def test_each_end_of_each_range_is_a_drive_too(z_g: int) -> None:
    drive = made(z_g=z_g, diameter=63.5)
    values = {path: drive.value(path) for path in field_table()}
    for path, source in drive.source.items():
        for end in source.range or ():
            assert not list(conflicts(values | {path: end})), (path, end)


def test_only_sizes_change_in_a_drive_twice_as_large() -> None:
    like = load_preset("vzp160", ["bearing.g_b=4"])  # all that has a law has a size
    small, large = made(like, diameter=40.0), made(like, diameter=80.0)
    deviation_sizes = [
        path for path in LAWS if path in small.source and isinstance(small.value(path), float) and small.value(path)
    ]
    assert {LAWS[path].by for path in deviation_sizes} == {law.by for law in LAWS.values()}
    for path in deviation_sizes:
        power = {"same": 0, "d": 1, "m": 1, "1/d": -1, "sqrt d": 0.5}[LAWS[path].by]
        assert isclose(large.value(path) / small.value(path), 2**power, rel_tol=1e-3), path
    assert isclose(large.rated_torque / small.rated_torque, 8, rel_tol=1e-2)


def test_stiffness_grows_with_the_cube_of_the_diameter() -> None:
    K = [np.array([s.stiffness for s in stiffness(made(diameter=d), points=2, run=UNCHECKED).positive])
         for d in (40.0, 80.0)]  # fmt: skip
    np.testing.assert_allclose(K[1] / K[0], 8, rtol=0.01)


@pytest.mark.parametrize(("z_g", "d"), [(60, 400.0 * 60 / 100), (165, 63.0), (640, 320.0)])
def test_it_can_be_computed(z_g: int, d: float) -> None:
    drive = made(z_g=z_g, diameter=d)
    states = pitch_locked_states(Kinematics.of(drive), np.arange(100), 0.3)  # neighbours: far states are slow
    for torque in drive.operation.M_g:
        found = kinematic_error(drive, torque, states=states, run=UNCHECKED)
        assert 0 < found.range_arcsec < found.wind_up_arcsec


def test_what_was_asked_for_is_given_and_nothing_else() -> None:
    drive = made(z_g=200, diameter=63.5, torque=67.0)
    given_paths = {path for path, source in drive.source.items() if source.kind == "given"}
    assert given_paths == {"gears.z_g", "gears.z_b", "gears.m", "operation.rated"}
    assert {row.kind for row in resolved_fields(drive)} <= {"given", "assumed", "default", "unknown"}
    assert origin_counts(drive)["given"] == 4
    assert {path for path, s in made().source.items() if s.kind == "given"} == set()


@pytest.mark.parametrize(("diameter", "lost_motion"), [(27.9, 180), (35.56, 60), (165.1, 60)])
def test_new_drive_has_catalogue_play_and_no_assumed_accuracy(diameter, lost_motion) -> None:
    said = made(z_g=200, diameter=diameter).catalogue
    assert (said.play, said.lost_motion, said.accuracy) == (5, lost_motion, None)


def test_every_assumed_value_has_a_reason_and_independent_ones_ranges() -> None:
    drive = made(z_g=160, diameter=63.0)
    coupled = {"gears.m", "gears.alpha", "gears.x_g", "gears.x_b"}  # moved one by one they make no drive
    coupled |= {"catalogue.lost_motion", "catalogue.play"}  # limits
    assert all(source.ref for source in drive.source.values())
    assumed = {path: source for path, source in drive.source.items() if source.kind == "assumed" and path in measures()}
    assert {path for path, source in assumed.items() if source.range is None} == coupled & set(assumed) != set()


def test_every_field_of_parts_has_a_law() -> None:
    parts = ("gears.", "material.", "flexspline.", "bearing.", "cam.", "supports.", "contact.")
    chosen = {"gears.z_g", "gears.z_b", "gears.m", "gears.x_g", "gears.x_b"}
    assert {path for path in field_table() if path.startswith(parts)} == chosen | (set(LAWS) - {"operation.dT"})


def test_what_nobody_knows_is_unknown_and_not_zero() -> None:
    rows = {row.path: row for row in resolved_fields(made(z_g=160, diameter=63.0))}
    of_deviations = {path for path in rows if path.startswith(("tolerances.", "phases.", "harmonics."))}
    unknown = {path for path, row in rows.items() if row.kind == "unknown"}
    assert unknown == of_deviations - {"tolerances.F_i1", "tolerances.F_i2"}


def test_ranges_are_those_of_the_known_drive_at_its_size() -> None:
    entries = similar(LIKE, {})
    for path in ("gears.j_n", "flexspline.k_t", "bearing.ring_h", "supports.C_2", "contact.k_face", "contact.c_ball"):
        assert entries[path].range == LIKE.source[path].range
        assert entries[path].value == LIKE.value(path)
    assert entries["cam.W_0"].range == (0.8, 1.016)


def test_similar_drive_scales_the_tooth_compliance_that_the_template_uses() -> None:
    whole = LIKE.model_copy(update={"numerics": LIKE.numerics.model_copy(update={"stations": 1})})
    used = {"contact.k_face", "contact.c_t"}
    assert set(similar(LIKE, {})) & used == {"contact.k_face"}
    assert set(similar(whole, {})) & used == {"contact.c_t"}


def test_tolerances_follow_the_standard() -> None:
    assert [round(F_p(160, 0.8, accuracy)) for accuracy in (6, 7, 8, 9)] == [28, 40, 56, 79]
    F_i1 = similar(LIKE, {})["tolerances.F_i1"]
    assert (F_i1.value, F_i1.range) == (40, (0, 56))


def of_unknown_quality(**wish: str) -> Drive:
    required = read_requirements(LIKE, pitch_diameter="50.8", ratio=100.0, quality="unknown", **wish)
    return load_text(similar_preset("own", LIKE, required), "own")


def test_drive_of_unknown_quality_has_wide_assumed_tolerances() -> None:
    drive = of_unknown_quality()
    for path in ("tolerances.F_i1", "tolerances.F_i2"):
        source = drive.source[path]
        assert source.kind == "assumed"
        low, high = source.range or (0.0, 0.0)
        assert (round(low), round(high)) == (round(F_p(50.8, 0.254, 5)), round(F_p(50.8, 0.254, 11)))
        assert "assumed to be wide" in source.ref
    assert drive.catalogue.play is drive.catalogue.lost_motion is None  # nobody promises anything
    assert of_unknown_quality(lost_motion="90").catalogue.lost_motion == 90


def test_the_test_of_an_accuracy_needs_the_accuracy() -> None:
    required = read_requirements(LIKE, ratio=100.0, accuracy="30", accuracy_test="12_positions")
    drive = load_text(similar_preset("own", LIKE, required), "own")
    assert (drive.catalogue.accuracy, drive.catalogue.accuracy_test) == (30, "12_positions")
    with pytest.raises(UsageError, match="--accuracy is not given"):
        read_requirements(LIKE, ratio=100.0, accuracy_test="12_positions")
    with pytest.raises(UsageError, match="invalid --accuracy-test positions"):
        read_requirements(LIKE, ratio=100.0, accuracy="30", accuracy_test="positions")


def test_a_known_quality_is_as_before() -> None:
    plain = similar_preset("own", LIKE, read_requirements(LIKE, ratio=100.0))
    assert similar_preset("own", LIKE, read_requirements(LIKE, ratio=100.0, quality="catalogue")) == plain
    with pytest.raises(UsageError, match="invalid --quality good"):
        read_requirements(LIKE, quality="good")


@pytest.mark.parametrize("kind", ["ring", "plastic"])
def test_flexspline_outside_the_model_is_refused_with_the_reason(kind: str) -> None:
    refused = f"--flexspline {kind} is not supported: .{{20}}"
    with pytest.raises(UsageError, match=refused):
        read_requirements(LIKE, flexspline=kind)
    assert read_requirements(LIKE, flexspline="cup") == read_requirements(LIKE)


def test_modulus_unlike_that_of_steel_raises_a_warning() -> None:
    for E, count in ((2500, 1), (205000, 0)):
        drive = load_preset("vzp160", [f"material.E={E}"])
        assert sum("material.E" in text for text in drive.origin.warnings) == count


@pytest.mark.thorough
def test_measured_drives_without_a_brand_lie_within_their_predicted_range(tmp_path: Path) -> None:
    made_by = ("presets", "new", "own", "--ratio", "100", "--pitch-diameter", "50.8", "-o", "own.yaml")
    ranges = {}
    for quality in ("catalogue", "unknown"):
        assert run(*made_by, "--quality", quality, "--force", cwd=tmp_path).returncode == 0
        answer = run("check", "own.yaml", "--torque", "2.56", "--draws", "24", "--json", cwd=tmp_path)
        belief = json.loads(answer.stdout)["operating_points"][0]["belief"]
        ranges[quality] = (belief["p5_arcsec"], belief["p95_arcsec"])
    for measured_arcsec in (120, 145):  # of two drives of size 20
        assert ranges["unknown"][0] < measured_arcsec < ranges["unknown"][1]
        assert measured_arcsec > ranges["catalogue"][1]


@pytest.mark.parametrize(
    ("wish", "d"),
    [
        ({}, 160.0),
        ({"torque": 100.0}, 80.0),  # an eighth of the 800 N*m at 160 mm
        ({"stiffness": (3.1e4, 5e4, 5.7e4)}, 63.78),  # size 25 of catalogues: 63.5 mm
        ({"stiffness": (54e4, 88e4, 98e4)}, 164.6),  # size 65: 165.1 mm
        ({"diameter": 63.5, "stiffness": (3.1e4, 5e4, 5.7e4)}, 63.5),
    ],
)
def test_the_size_follows_from_what_is_given(wish: dict[str, object], d: float) -> None:
    drive = made(**wish)
    assert isclose(drive.gears.m * drive.gears.z_g, d, rel_tol=1e-3)


def test_given_stiffness_scales_the_contacts_by_its_share() -> None:
    plain, stiff = made(diameter=80.0), made(diameter=80.0, stiffness=(1e5, 1.9e5, 2.25e5))  # twice 9e5 / 8
    for path in ("contact.c_ball", "contact.c_bore"):
        assert isclose(stiff.value(path) * 2, plain.value(path), rel_tol=1e-3)
    for path in ("supports.C_2", "contact.k_face"):
        assert isclose(stiff.value(path), 2 * plain.value(path), rel_tol=1e-3)
    assert stiff.flexspline == plain.flexspline
    assert "x 2 for K3" in stiff.source["supports.C_2"].ref


@pytest.mark.parametrize(
    ("wish", "message"),
    [
        ({"diameter": 20.0, "torque": 800.0}, "a rated torque of 800 N*m contradicts a pitch diameter of 20 mm"),
        ({"diameter": 160.0, "torque": 8.0}, "contradicts a pitch diameter of 160 mm"),
        ({"diameter": 160.0, "stiffness": (3.1e4, 5e4, 5.7e4)}, "contradicts a pitch diameter of 160 mm"),
        ({"torque": 800.0, "stiffness": (3.1e4, 5e4, 5.7e4)}, "800 N*m contradicts a pitch diameter of 63.78 mm"),
        ({"stiffness": (5e4, 3e4, 6e4)}, "K1, K2, K3 must be above 0 and increase"),
        ({"diameter": 20.0, "z_g": 640}, "gears.m would be 0.0312 mm"),
    ],
)
def test_contradictions_are_refused(wish: dict[str, object], message: str) -> None:
    with pytest.raises(UsageError) as caught:
        made(**wish)
    assert message in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize("like", ["synthetic-160-162", "tests/data/small.yaml"])
def test_it_is_like_any_other_drive(like: str) -> None:
    other = load_preset(like)
    drive = made(other, diameter=50.0)
    assert isclose(drive.cam.W_0 / drive.gears.m, other.cam.W_0 / other.gears.m, rel_tol=1e-3)
    assert (drive.bearing.d_ball is None) == (other.bearing.d_ball is None)
