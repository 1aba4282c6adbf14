"""Fields that do not go together: each conflict is found, alone, and at the field to look at first."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from scipy.optimize import brentq

from hdassist.drive.loading import load_text
from hdassist.drive.model.geometry import Geometry, flank_candidates
from hdassist.drive.model.rules import BEARING_FIELDS, FIELD_RULES, MAX_OVERLAP, MODEL_RULES, conflicts
from hdassist.drive.preset.fields import Drive, field_table
from hdassist.run.errors import UsageError

REFERENCE = (Path(__file__).parents[1] / "validation/vzp160_reference.yaml").read_bytes()


def load(*overrides: str) -> Drive:
    return load_text(REFERENCE, "reference", overrides)


def values() -> dict[str, object]:
    drive = load()
    return {path: getattr(getattr(drive, path.split(".")[0]), path.split(".")[1]) for path in field_table()}


@pytest.mark.parametrize(
    ("overrides", "path", "message"),
    [
        (["gears.z_b=200"], "gears.z_b", "needs more teeth than the flexspline (got z_b - z_g = 0)"),
        (["gears.z_b=198"], "gears.z_b", "needs more teeth than the flexspline (got z_b - z_g = -2"),
        (["gears.z_b=204"], "gears.z_b", "only drives with two waves and z_b - z_g = 2 are supported"),
        (["gears.x_g=1.8"], "gears.x_g", "the teeth do not reach each other"),
        (["gears.h_a=1.2"], "gears.h_a", "the tips interfere: they do not clear each other at the minor axis"),
        (["cam.W_0=1.57"], "cam.W_0",
         "the tips of the flexspline reach the roots of the circular spline"),
        (["gears.h_f=0.5"], "gears.h_f",
         "the tips of the circular spline reach the roots of the flexspline"),
        (["cam.W_0=1.2"], "cam.W_0", "the teeth interfere: they overlap"),
        (["gears.h_a=1.18"], "gears.h_a", "the teeth interfere: they overlap"),
        (["gears.x_g=12", "gears.x_b=12"], "gears.x_g", "the teeth of the flexspline are pointed"),
        (["gears.x_g=-1", "gears.x_b=-0.8", "gears.z_g=20", "gears.z_b=22", "gears.m=5"], "gears.x_b",
         "the circular spline has no involute flank: its tip lies inside the base circle"),
        (["flexspline.l=32"], "flexspline.l",
         "the shell must be longer than the tooth ring (got l 32 mm, b_w 32 mm)"),
        (["flexspline.h_1=17"], "flexspline.h_1", "the rim is too thick"),
        (["bearing.ring_h=17"], "bearing.ring_h", "the ring is too thick"),
        (["bearing.d_ball=17.6"], "bearing.d_ball", "the bearing has no room for 24 balls"),
        (["bearing.d_ball=80"], "bearing.d_ball", "does not fit inside the raceway"),
        (["bearing.ball_motion=rolling", "bearing.d_ball="], "bearing.ball_motion",
         "rolling balls require bearing.d_ball"),
        (["supports={C_1: 0, C_2: 0, C_3: 0}"], "supports.C_1", "C_1, C_2 and C_3 are all 0"),
        (["supports.C_1=1e-6"], "supports.C_1",
         "the support is too soft for the equations to be solved (got 1e-06 N/mm; use 0 if nothing supports "
         "the part, otherwise at least 1 N/mm)"),
        (["supports.C_2=0.99"], "supports.C_2", "the support is too soft"),
        (["supports.C_3=1e-30"], "supports.C_3", "the support is too soft"),
        (["operation.M_g=[]"], "operation.M_g", "needs at least one torque"),
        (["operation.M_g=[80, 0.0]"], "operation.M_g", "at a torque of 0, the rotation is undetermined"),
        (["operation.M_g=[80, 8e1]"], "operation.M_g", "a torque is given twice (got 80)"),
        (["catalogue.T_1=200", "catalogue.T_2=200"], "catalogue.T_1", "must end below the second (got T_1 200"),
        (["catalogue.T_2=1e-9"], "catalogue.T_2", "too small for the end of a segment (got 1e-09 N*m; above 0.08 N*m)"),
        (["mounting.allowed=[0, 12, -1]"], "mounting.allowed",
         "the seat does not have these holes (got -1, 12; its holes are 0 to 11)"),
        (["mounting.allowed=[3, 3]"], "mounting.allowed", "a hole is given twice"),
        (["mounting.allowed=[]"], "mounting.allowed", "the list of holes is empty"),
        (["mounting.allowed=3", "mounting.holes=0"], "mounting.allowed", "(holes: 0) has no holes"),
        (["numerics.n_2=79"], "numerics.n_2", "too few nodes for the bending modes"),
    ],
)  # fmt: skip
def test_conflicts_are_refused(overrides: list[str], path: str, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        load(*overrides)
    lines = caught.value.message.splitlines()
    assert any(f": {path}: " in line and message in line for line in lines), lines


@pytest.mark.parametrize(
    "overrides",
    [
        ["gears.h_a=1.0"], ["cam.W_0=0.9"], ["cam.W_0=1.0"], ["gears.x_g=3.0"],
        ["gears.z_g=198", "gears.z_b=200"],
        ["gears.h_f=1.25"], ["flexspline.l=32.1"], ["bearing.d_ball=17.5"], ["supports.C_1=0"],
        ["supports={C_1: 0, C_2: 0, C_3: 1}"], ["operation.M_g=[80, -80]"], ["mounting.allowed=[0, 11]"],
        ["mounting.holes=0"], ["bearing.ball_motion=rolling"], ["numerics.n_2=80"], ["bearing.d_ball="],
    ],
)  # fmt: skip
def test_what_just_goes_together_is_accepted(overrides: list[str]) -> None:
    load(*overrides)


def test_independent_conflicts_are_reported_at_once() -> None:
    with pytest.raises(UsageError) as caught:
        load("gears.z_b=203", "flexspline.l=20", "bearing.d_ball=30", "operation.M_g=[0]", "numerics.n_2=20")
    assert len(caught.value.message.splitlines()) == 5


def test_checks_run_only_where_their_fields_are_valid() -> None:
    given = values()
    assert list(conflicts(given)) == []
    broken = given | {"flexspline.l": 1.0, "operation.M_g": ()}
    assert [c.path for c, _ in conflicts(broken)] == ["flexspline.l", "operation.M_g"]
    del broken["flexspline.b_w"]
    assert [c.path for c, _ in conflicts(broken)] == ["operation.M_g"]
    assert list(conflicts({})) == []


def test_every_check_needs_fields_that_exist() -> None:
    given = values()
    names = {path.split(".")[1] for path in given}
    for rule in FIELD_RULES:
        assert {*rule.names, rule.path.split(".")[1]} <= names, rule
    assert {path for paths in (*MODEL_RULES.values(), BEARING_FIELDS) for path in paths} <= given.keys()


def overlap(drive: Drive) -> float:
    """Greatest overlap [mm] that the contact model finds on the nominal flanks from axis to axis."""
    return -float(flank_candidates(Geometry.of(drive)).gap.min()) - drive.gears.j_n * 1e-3


@pytest.mark.parametrize("curve", ["linear", "inextensible"])
@pytest.mark.parametrize("teeth", [(200, 202), (199, 201)])
def test_drives_beyond_the_overlap_of_the_contact_model_are_refused(curve: str, teeth: tuple[int, int]) -> None:
    sets = [f"numerics.nominal_curve={curve}", f"gears.z_g={teeth[0]}", f"gears.z_b={teeth[1]}"]
    drive = load(*sets)
    limit = MAX_OVERLAP * drive.gears.m
    W_0 = brentq(lambda W_0: overlap(drive.with_values({"cam.W_0": W_0})) - limit, 0.96, 1.3, xtol=1e-9)
    load(*sets, f"cam.W_0={W_0 * 0.9999}")
    with pytest.raises(UsageError, match="the teeth interfere"):
        load(*sets, f"cam.W_0={W_0 * 1.0001}")


@pytest.mark.parametrize("W_0", [1.15, 1.2, 1.3])
def test_the_message_has_the_overlap_of_the_contact_model(W_0: float) -> None:
    with pytest.raises(UsageError) as caught:
        load("numerics.nominal_curve=inextensible", f"cam.W_0={W_0}")
    drive = load("numerics.nominal_curve=inextensible").with_values({"cam.W_0": W_0})
    assert f"an overlap of {overlap(drive) * 1e3:.3g} um" in caught.value.message


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("numerics.window=30", "numerics.window: unknown key (leave it out; every tooth"),
        ("alternatives=[1]", "alternatives: unknown key (leave it out; commands no longer read it)"),
    ],
)
def test_what_presets_had_once_is_refused_with_a_hint(override: str, message: str) -> None:
    with pytest.raises(UsageError, match=re.escape(message)):
        load(override)
